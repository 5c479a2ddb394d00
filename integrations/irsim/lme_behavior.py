"""LME and every other system of lme as a behaviour of an ir-sim robot.

    import irsim, lme_behavior                      # the import registers the behaviour
    env = irsim.make("world.yaml")                  # behavior: {name: lme, system: lme_plus}

The robot needs `kinematics: {name: diff}` and a `lidar2d`; nothing but its scan shows it the obstacles.
"""

import math
from typing import Any

import numpy as np
from irsim.lib import register_behavior_class

import lme


@register_behavior_class("diff", "lme")
class LmeBehavior:
    """The velocity (2, 1) [m/s, rad/s] that a system of lme commands for one robot.

    Keys of `behavior:` in the world's YAML: system, a name of conf/system/ (lme_plus); seed of its candidates (0).
    """

    def __init__(self, info: Any, system: str = "lme_plus", seed: int = 0, **_: Any) -> None:
        self.system, self.seed = system, seed
        self.navigator: lme.Navigator | None = None

    def __call__(self, ego_object: Any, **_: Any) -> np.ndarray:
        if ego_object.goal is None:
            return np.zeros((2, 1))
        if self.navigator is None:  # only now is the robot's lidar known
            self.robot = robot_of(ego_object)
            self.navigator = lme.load_system(self.system, self.robot)
        if not ego_object.trajectory:  # the first step, also after env.reset()
            self.navigator.reset(np.random.default_rng(self.seed))
        return np.array(self.navigator.act(observe(ego_object, self.robot)))[:, None]


def robot_of(ego: Any) -> lme.Robot:
    """Outline, limits, control period and lidar of an ir-sim robot."""
    (v_max, omega_max), (v_min, _) = ego.vel_max[:, 0], ego.vel_min[:, 0]
    dt = ego.world_param.step_time
    at_once = (
        2.0 * ego.vel_max[:, 0] / dt
    )  # no limit: from full speed backwards to full speed ahead in one step
    alpha_v, alpha_omega = np.minimum(ego.info.acce[:, 0], at_once)
    return lme.Robot(
        ego.name,
        footprint_of(ego),
        float(v_max),
        float(omega_max),
        float(alpha_v),
        float(alpha_omega),
        control_rate=1.0 / dt,
        lidar=lidar_of(ego),
        v_min=min(float(v_min), 0.0),
    )


def footprint_of(ego: Any) -> lme.Footprint:
    """A circle or a rectangle as it is; another outline as the disc about it."""
    if ego.shape == "rectangle":
        return lme.Footprint(length=float(ego.length), width=float(ego.width))
    return lme.Footprint(radius=float(ego.radius if ego.shape == "circle" else ego.radius_extend))


def lidar_of(ego: Any) -> lme.Lidar:
    """The robot's lidar2d; in a full circle ir-sim's last beam is its first again, and is left out."""
    if ego.lidar is None:
        raise lme.InputError(f"{ego.name} has no lidar: add `sensors: [{{name: lidar2d, …}}]` to the robot")
    sensor = ego.lidar
    x, y, yaw = sensor.offset[:3, 0]
    beams = sensor.number - (sensor.angle_range >= 2 * math.pi - 1e-6)
    ranges = (float(sensor.range_min), float(sensor.range_max))
    return lme.Lidar(beams, float(sensor.angle_range), *ranges, x=float(x), y=float(y), yaw=float(yaw))


def observe(ego: Any, robot: lme.Robot) -> lme.Observation:
    """What the robot knows: its scan, the goal, its velocity and its pose."""
    x, y, yaw = map(float, ego.state[:3, 0])
    dx, dy = ego.goal[:2, 0] - (x, y)
    ahead = np.array([math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx])
    return lme.Observation(
        scan_of(ego.get_lidar_scan(), robot.lidar),
        ahead,
        lme.Twist(*map(float, ego.velocity[:2, 0])),
        robot.limits,
        lme.Pose(x, y, yaw),
    )


def scan_of(given: dict[str, Any], lidar: lme.Lidar) -> lme.LaserScan:
    """A scan of ir-sim. A range of range_max without a return is infinite here."""
    ranges = np.asarray(given["ranges"])[: lidar.num_beams]
    missed = ~np.asarray(given["valid"])[: lidar.num_beams] & (ranges >= lidar.range_max)
    ranges = np.where(missed, np.inf, ranges).astype(np.float32)
    return lme.LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)
