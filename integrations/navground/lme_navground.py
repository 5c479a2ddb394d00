"""LME and every other system of lme as a behaviour of a navground agent.

    import lme_navground                            # the import registers the behaviour
    # in a scenario's YAML: behavior: {type: LME, system: lme_plus}
    #                       state_estimations: [{type: Lidar, range: 8, resolution: 181}]

The agent needs 2WDiff kinematics and a Lidar. With a sensor of type Discs it also knows how its neighbours move;
without it, nothing but the scan shows it the other agents.
"""

import math
from typing import Any

import numpy as np
from navground import core
from navground.core import schema
from navground.sim.state_estimations import LidarStateEstimation

import lme

FAR = 10.0  # [m] a target that is only a direction is a point at this distance
MOVED = 0.5  # [m] a target that jumps farther than this is another one


class LmeBehavior(core.Behavior, name="LME"):  # type: ignore[call-arg,misc,unused-ignore]
    """The twist that a system of lme commands for one agent."""

    def __init__(self, kinematics: core.Kinematics | None = None, radius: float = 0.0) -> None:
        core.Behavior.__init__(self, kinematics, radius)
        self._state, self._system, self._seed = core.SensingState(), "lme_plus", 0
        self._navigator: lme.Navigator | None = None
        self._robot: lme.Robot
        self._target = np.full(2, np.inf)  # in the world [m]

    @property
    @core.register("lme_plus", "A system of conf/system/")  # type: ignore[untyped-decorator]
    def system(self) -> str:
        """The system, a name of conf/system/."""
        return self._system

    @system.setter
    def system(self, value: str) -> None:
        self._system = value

    @property
    @core.register(0, "Seed of its random numbers", schema.positive)  # type: ignore[untyped-decorator]
    def seed(self) -> int:
        """Seed of the candidates' random numbers."""
        return self._seed

    @seed.setter
    def seed(self, value: int) -> None:
        self._seed = value

    def get_environment_state(self) -> core.SensingState:
        """The buffers that the agent's sensors fill."""
        return self._state

    def compute_cmd_internal(self, time_step: float) -> core.Twist2:
        """The command for one control period; zero without a target."""
        target = target_of(self)
        if target is None:
            return core.Twist2((0.0, 0.0), 0.0, core.Frame.relative)
        scan = LidarStateEstimation.read_scan_with_name(self._state, "")
        if scan is None:
            raise lme.InputError("the agent has no Lidar: add one to its state_estimations")
        if self._navigator is None:
            self._robot = robot_of(self, scan, time_step)
            self._navigator = lme.load_system(self._system, self._robot)
        if math.dist(target, self._target) > MOVED:
            self._navigator.reset(np.random.default_rng(self._seed))
        self._target = target
        v, omega = self._navigator.act(self._observe(scan))
        return core.Twist2((v, 0.0), omega, core.Frame.relative)

    def _observe(self, scan: Any) -> lme.Observation:
        x, y = map(float, self.position)
        twist = self.get_twist(core.Frame.relative)
        here = lme.Pose(x, y, float(self.orientation))
        ahead = rotated(self._target - self.position, -here.yaw)
        moving = lme.Twist(float(twist.velocity[0]), float(twist.angular_speed))
        return lme.Observation(
            scan_of(scan, self._robot.lidar), ahead, moving, self._robot.limits, here, neighbours(self._state)
        )


def target_of(behavior: core.Behavior) -> np.ndarray | None:
    """Where the agent has to go, in the world [m]; None if it may stand."""
    if behavior.check_if_target_satisfied():
        return None
    point = behavior.get_target_position(core.Frame.absolute)
    if point is not None:
        return np.asarray(point, dtype=float)
    direction = behavior.get_target_direction(core.Frame.absolute)
    return (
        None
        if direction is None
        else np.asarray(behavior.position + FAR * np.asarray(direction), dtype=float)
    )


def robot_of(behavior: core.Behavior, scan: Any, time_step: float) -> lme.Robot:
    """A disc with the agent's limits, control period and lidar. navground's wheels have no limit of acceleration."""
    kinematics = behavior.kinematics
    v_max = min(kinematics.max_speed, behavior.optimal_speed)
    omega_max = kinematics.max_angular_speed
    at_once = 2.0 / time_step  # from full speed backwards to full speed ahead in one step
    beams = len(scan.ranges) - (
        scan.fov >= 2 * math.pi - 1e-6
    )  # in a full circle the last is the first again
    middle = scan.start_angle + scan.fov / 2.0
    return lme.Robot(
        "navground",
        lme.Footprint(radius=float(behavior.radius)),
        float(v_max),
        float(omega_max),
        float(at_once * v_max),
        float(at_once * omega_max),
        control_rate=1.0 / time_step,
        lidar=lme.Lidar(beams, float(scan.fov), 0.0, float(scan.max_range), yaw=float(middle)),
        v_min=-float(getattr(kinematics, "max_backward_speed", 0.0)),
    )


def scan_of(scan: Any, lidar: lme.Lidar) -> lme.LaserScan:
    """A scan of navground; a range of max_range is one without a return."""
    ranges = np.array(scan.ranges[: lidar.num_beams], dtype=np.float32)
    ranges[ranges >= np.float32(lidar.range_max)] = np.inf
    return lme.LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)


def neighbours(state: core.SensingState) -> np.ndarray:
    """Position [m] and velocity [m/s] (P, 4) of the nearest moving discs, in the agent's frame, from a Discs sensor."""
    position, velocity = state.get_buffer("position"), state.get_buffer("velocity")
    if position is None or velocity is None:
        return np.empty((0, 4))
    valid = np.asarray(state.get_buffer("valid").data, dtype=bool).ravel()
    rows = np.hstack([np.asarray(position.data), np.asarray(velocity.data)]).reshape(-1, 4)[valid]
    return np.asarray(rows[np.hypot(rows[:, 2], rows[:, 3]) > 0.0])


def rotated(vector: np.ndarray, angle: float) -> np.ndarray:
    """A vector (2,), turned by an angle [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])
