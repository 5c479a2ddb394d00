"""Tubes: which are free to drive, and which are out of view."""

import math

import numpy as np
import pytest

from lme.geometry.collision import sweep
from lme.planners.motion_tubes.kernels import (
    arc_pose,
    free_tubes,
    whisker_free,
)
from lme.planners.motion_tubes.tubes import forward_tubes
from lme.robots import Lidar
from tests.builders import SHIPPED, shipped, stage
from tests.lme.planners.motion_tubes.scenes import JACKAL, NO_EDGES, scattered, spec_of, view_of


def tubes_free(robot, circles, spec):
    view, seen = view_of(robot, circles)
    tubes = forward_tubes(spec, view)
    return tubes, free_tubes(seen, tubes.needs, tubes.farthest, tubes.hidden)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_free_tube_is_free_to_drive(name):
    robot = shipped(name)
    driven = 0
    for seed in range(25):
        circles = scattered(seed, 12)
        tubes, free = tubes_free(robot, circles, spec_of(robot))
        for curvature in tubes.curvatures[free]:
            poses = np.array([arc_pose(curvature, way) for way in np.linspace(0.0, tubes.length, 40)])
            clearance, contact = sweep(poses, robot.footprint.box, circles, NO_EDGES)
            assert contact < 0
            assert clearance > 0.03  # of the 0.05 m, less what the outside of a turn needs beside the robot
            driven += 1
    assert driven > 50


@pytest.mark.parametrize("name", SHIPPED)
def test_all_tubes_are_free_in_the_open_and_one_obstacle_closes_those_through_it(name):
    robot = shipped(name)
    spec = spec_of(robot)
    tubes, free = tubes_free(robot, np.empty((0, 3)), spec)
    assert free.all()
    for curvature in tubes.curvatures[[0, 5, 6, -1]]:
        x, y, _ = arc_pose(curvature, tubes.length)
        _, free = tubes_free(robot, np.array([[x, y, 0.075]]), spec)
        assert not free[tubes.curvatures == curvature][0]
        assert free.any()


def test_tubes_behind_an_obstacle_are_not_free():
    # Beside the straight tube, but in front of the end of the most curved one, seen from the lidar.
    spec = spec_of(JACKAL, heading_step=math.pi / 2)
    tubes, free = tubes_free(JACKAL, np.array([[0.55, 0.5, 0.075]]), spec)
    assert dict(zip(np.sign(tubes.curvatures), free, strict=True)) == {0.0: True, 1.0: False, -1.0: True}
    poses = np.array([arc_pose(tubes.curvatures[2], way) for way in np.linspace(0.0, 0.9, 40)])
    assert sweep(poses, JACKAL.footprint.box, np.array([[0.55, 0.5, 0.075]]), NO_EDGES)[1] < 0


def test_tubes_out_of_view_are_not_free():
    robot = stage(fov=math.pi / 3, num_beams=90)
    _, free = tubes_free(robot, np.empty((0, 3)), spec_of(robot, length=2.0))
    assert not free.any()  # beside the robot it sees nothing
    robot = stage(fov=math.pi, num_beams=181, lidar=Lidar(181, math.pi, 0.02, 15.0, x=-0.1))
    _, free = tubes_free(robot, np.empty((0, 3)), spec_of(robot))
    assert free[0]


def test_a_whisker_is_closed_where_the_tube_is_not():
    spec = spec_of(JACKAL)
    gap = 0.155 + 0.05 + 0.05 + 0.075  # beside the straight tube's end, half a whisker off
    for y, outer in ((gap, True), (-gap, True), (0.6, False)):
        view, seen = view_of(JACKAL, np.array([[0.9 + 0.21 + 0.1, y, 0.075]]))
        tubes = forward_tubes(spec, view)
        free = free_tubes(seen, tubes.needs, tubes.farthest, tubes.hidden)
        assert free[0]
        assert whisker_free(seen, tubes.whisker_beams[0, 0], tubes.whisker_ranges[0, 0]) != outer
        assert whisker_free(seen, tubes.whisker_beams[1, 0], tubes.whisker_ranges[1, 0])
