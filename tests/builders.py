"""Small robots, observations and tasks for tests."""

import math

import numpy as np

from lme.robots import Footprint, Lidar, Robot
from lme.types import LaserScan, Observation, Pose, Twist
from lme.worlds.world import Task, World

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


def observation(target=(4.0, 0.0), ranges=None, twist=Twist(0.0, 0.0), robot=None):  # noqa: B008
    """What `robot` sees; without ranges, nothing."""
    robot = robot or stage()
    lidar = robot.lidar
    if ranges is None:
        ranges = np.full(lidar.num_beams, lidar.range_max, dtype=np.float32)
    scan = LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)
    return Observation(scan, np.array(target, dtype=float), twist, robot.limits)


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
