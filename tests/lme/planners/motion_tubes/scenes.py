"""Scenes and tubes for the tests of motion tubes."""

import math

import numpy as np

from lme.perception.raycast import cast_shapes
from lme.planners.motion_tubes.tubes import TubeSpec, lidar_view
from lme.types import LaserScan
from tests.builders import shipped

NO_EDGES, NONE = np.empty((0, 4)), np.empty((0, 2))
COARSE = math.radians(10.0)  # between tubes, where all of them would take long
JACKAL = shipped("jackal")


def scattered(seed, count, low=0.1, high=3.0):
    """Circles around the robot, none within `low` of its footprint's disc."""
    rng = np.random.default_rng(seed)
    bearings, ranges = rng.uniform(-np.pi, np.pi, count), rng.uniform(0.35 + low, high, count)
    return np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings), np.full(count, 0.075)))


def view_of(robot, circles):
    lidar = robot.lidar
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    ranges = cast_shapes(lidar.mount, angles, lidar.range_max, circles, NO_EDGES)
    return lidar_view(LaserScan(ranges, *angles[:2], lidar.range_min, lidar.range_max), lidar.mount)


def spec_of(robot, length=0.9, heading_step=COARSE, margins=(0.1, 0.05)):
    return TubeSpec(length, math.pi / 2, heading_step, robot.footprint.box, margins, (0.05, 0.1))
