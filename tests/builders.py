"""Small robots, observations, tasks and episodes for tests."""

import math
import warnings
from dataclasses import astuple, is_dataclass, replace

import numpy as np

import lme.guides.lme.guide
from lme.config.presets import load_robot, load_settings
from lme.guides.lme.guide import PAPER_CRITERIA, Lme, LocalMinimumEscaper
from lme.guides.target import Target, TargetConfig
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.robots import Cap, Footprint, Lidar, Robot
from lme.simulation.fast import FastSimulator
from lme.types import LaserScan, Observation, Pose, Twist
from lme.worlds.world import Task, World
from runners.config import catalogue
from runners.config.instantiate import fill_dataclass
from runners.records.episode_record import COLUMNS, EpisodeRecord

PUBLISHED = {  # paper §IV.D
    "a_close": 1.51,
    "a_dev": 1.56,
    "c_o": 999.8,
    "c_t": 205.84,
    "a_mount": 88.7,
    "c_h": 134.9,
    "d1": 0.51,
    "d2": 200.0,
}


def stage(fov=2 * math.pi, num_beams=540, **changes):
    """The robot of the Stage experiments."""
    lidar = Lidar(num_beams=num_beams, fov=fov, range_min=0.02, range_max=15.0)
    values = {
        "name": "stage",
        "footprint": Footprint(radius=0.2),
        "v_max": 0.5,
        "omega_max": math.pi / 2,
        "alpha_v": 2.0,
        "alpha_omega": 2.0,
        "control_rate": 5.0,
        "lidar": lidar,
    }
    return Robot(**{**values, **changes})


def robot_from(values):
    """A robot from a mapping as in `conf/robot/`; a warning about its collision radius is its author's."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return fill_dataclass(Robot, values, "robot")


def shipped(name):
    """A robot that ships."""
    return load_robot(name)


def challenge_jackal():
    """Jackal as the organisers' files of the BARN Challenge describe it to ROS."""
    return replace(shipped("jackal"), control_rate=20.0, footprint=Footprint(length=0.42, width=0.33))


ROBOTS = tuple(catalogue.shipped().options("robot"))
SHIPPED = tuple(
    name for name in ROBOTS if shipped(name).response is None
)  # those that obey in every simulator
CAP = Cap(v_max=1.0, omega_max=1.57)  # of sim=gazebo [m/s, rad/s]
WHEELS = Footprint(length=0.458, width=0.416)  # the outline of Jackal that collides in sim=skid


def without_errors(robot):
    """The robot with a planar lidar that does not err, fires every beam, and so sees a mirrored world mirrored."""
    robot.lidar = replace(robot.lidar, noise_std=0.0, native_beams=None, cloud=None)
    return robot


def navigator(robot, guide="lme", **settings):
    """The simple planner behind LME with the published parameters, or bare."""
    if guide == "lme":
        chosen = Lme(load_settings("guide/lme", parameters=PUBLISHED, **settings), robot)
    else:
        chosen = Target(TargetConfig(), robot)
    return Navigator(chosen, Simple(load_settings("planner/simple"), robot))


def observation(
    target=(4.0, 0.0),
    ranges=None,
    twist=Twist(0.0, 0.0),  # noqa: B008
    robot=None,
    odometry=Pose(0.0, 0.0, 0.0),  # noqa: B008
):
    """What `robot` sees; without ranges, nothing."""
    robot = robot or stage()
    lidar = robot.lidar
    if ranges is None:
        ranges = np.full(lidar.num_beams, lidar.range_max, dtype=np.float32)
    scan = LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)
    return Observation(scan, np.array(target, dtype=float), twist, robot.limits, odometry)


def task(world=None, start=Pose(0.0, 0.0, 0.0), goal=(4.0, 0.0), goal_tolerance=0.2, time_limit=60.0):  # noqa: B008
    """A task in an empty world unless one is given."""
    goal = np.array(goal, dtype=float)
    length = float(np.hypot(*(goal - np.array(start[:2]))))
    return Task(
        map_name="test",
        number=0,
        world=world or World(),
        start=start,
        goal=goal,
        goal_tolerance=goal_tolerance,
        time_limit=time_limit,
        clock_distance=0.0,
        shortest_path_length=length,
        optimal_time=length / 0.5,
    )


def room(side=10.0):
    """Four walls around the origin."""
    h = side / 2
    corners = np.array([[-h, -h], [h, -h], [h, h], [-h, h]])
    return World(segments=np.hstack([corners, np.roll(corners, -1, axis=0)]))


CLUTTER = World(
    circles=np.array([[1.5, 0.6, 0.2], [2.5, -0.5, 0.3], [-1.0, 1.0, 0.2]]),
    segments=np.array([[3.0, -1.0, 3.0, 1.5]]),
)


def only(**weights):
    """Parameters with these values, d1 and d2 that always keep, and nothing else."""
    return {**dict.fromkeys(PAPER_CRITERIA, 0.0), "d1": 0.0, "d2": math.inf, **weights}


def escaper(parameters=PUBLISHED, robot=None, seed=0, **settings):
    """LME with these settings, reset with the seed."""
    made = LocalMinimumEscaper(robot or stage(), parameters, load_settings("guide/lme", **settings))
    made.reset(np.random.default_rng(seed))
    return made


def explained(made, view):
    """The explanation of an escaper's decision on an observation."""
    made.decide(view)
    return made.explanation()


def inject(monkeypatch, *draws):
    """Let these (N, 2) candidates be drawn one after the other."""
    left = [np.array(draw, dtype=float) for draw in draws]
    monkeypatch.setattr(lme.guides.lme.guide, "sample", lambda *_: left.pop(0))


def wander(steps=30, seed=0, even=True, robot=None):
    """Observations and true poses of a robot that drives about at random."""
    robot, rng = robot or stage(), np.random.default_rng(seed)
    simulator = FastSimulator(load_settings("sim/fast", even_ramp=even), robot)
    seen = [simulator.reset(task(room(40.0), goal=(15.0, 5.0)), rng)]
    poses = [simulator.state.pose]
    for _ in range(steps):
        command = Twist(rng.uniform(0.1, robot.v_max), rng.uniform(-1, 1) * robot.omega_max)
        seen.append(simulator.step(command))
        poses.append(simulator.state.pose)
    return seen, poses


def escape(seed=0, robot=None, steps=25):
    """Observations on the way of LME past some obstacles."""
    robot = robot or stage()
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    driver = navigator(robot)
    driver.reset(np.random.default_rng(seed))
    seen = [simulator.reset(task(CLUTTER), np.random.default_rng(seed))]
    for _ in range(steps):
        seen.append(simulator.step(driver.act(seen[-1])))
    return seen


def assert_same(one, two):
    """Two explanations or decisions, to the last bit."""
    if is_dataclass(one):
        one, two = astuple(one), astuple(two)
    if isinstance(one, tuple):
        assert len(one) == len(two)
        for a, b in zip(one, two, strict=True):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(one, two)


def episode_record(world, run=0, **columns):
    """A successful episode of LME. columns: what is not as usual; `world_measures` among them."""
    texts = dict.fromkeys(("global_map", "subset", "contact_part"), "") | {
        "ablation": "none",
        "weights": "published",
        "people": "truth",
    }
    texts |= {"system": "LME", "guide": "lme", "planner": "simple", "robot": "jackal", "map": "barn"}
    usual = dict.fromkeys(COLUMNS, 0) | texts | {"outcome": "success", "time_s": 9.0, "spl": 0.7}
    return EpisodeRecord(**{**usual, "world": world, "run": run, **columns})
