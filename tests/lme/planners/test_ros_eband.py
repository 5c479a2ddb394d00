"""eband_local_planner on move_base: its speeds, its turns, what it forgets and when it stops, by hand."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.grids.obstacle_grid import TOUCHING
from lme.planners.ros_eband.planner import RosEBand
from lme.types import Guidance, Pose, Twist
from lme.worlds.world import World
from tests.builders import challenge_jackal
from tests.lme.planners.test_ros_dwa import LOST, seen

JACKAL = challenge_jackal()
FREE = 2.0 * 0.7 * math.log(252.0) / 10.0  # [m/s] 0.774: all bubbles of a free map have a radius of 0.553 m
WALL = World(segments=np.array([[0.9, -3.0, 0.9, 3.0]]))


def planner(**changes):
    made = RosEBand(load_settings("planner/ros_eband", **changes), JACKAL)
    made.reset(np.random.default_rng(0))
    return made


def ahead(*points):
    """Guidance along corners in the robot frame, from the robot on."""
    path = np.array([(0.0, 0.0), *points])
    return Guidance(path[-1], path)


def view(world=None, twist=Twist(FREE, 0.0), pose=Pose(0.0, 0.0, 0.0)):  # noqa: B008
    return seen(world, pose=pose, twist=twist, target=(6.0, 0.0), robot=JACKAL)


def test_free_space_is_crossed_at_the_speed_of_the_widest_bubble():
    command = planner().plan(view(), ahead((6.0, 0.0)))
    assert command == pytest.approx((FREE, 0.0), abs=1e-6)
    slower = planner(max_vel_lin=0.75).plan(view(), ahead((6.0, 0.0)))
    assert slower.v == pytest.approx(0.75 * FREE)


def test_it_drives_half_as_fast_within_075_m_of_the_end():
    assert planner().plan(view(), ahead((0.7, 0.0))).v == pytest.approx(FREE / 2.0)
    assert planner().plan(view(), ahead((0.8, 0.0))).v == pytest.approx(FREE)


def test_it_turns_on_the_spot_to_a_bubble_to_the_side_however_near_the_walls_are():
    beside = World(segments=np.array([[-1.0, -0.32, 1.0, -0.32]]))
    for world in (None, beside):
        command = planner().plan(view(world, twist=Twist(0.0, 0.0)), ahead((0.0, 3.0)))
        assert command == pytest.approx((0.0, 1.0))


def test_a_plan_through_an_obstacle_empties_the_map_and_the_robot_drives_on():
    made = planner()
    command = made.plan(view(WALL), ahead((6.0, 0.0)))
    assert command.v == pytest.approx(FREE, abs=1e-3)
    assert not made._costmap.costs.any()
    # The next scan fills the map again.
    made._costmap.update(view(WALL))
    assert (made._costmap.costs == TOUCHING).any()


def test_without_a_new_plan_an_obstacle_on_the_band_stops_the_robot():
    made = planner()
    assert made.plan(view(), ahead((6.0, 0.0))).v > 0.0
    assert made.plan(view(WALL), LOST) == (0.0, 0.0)


def test_without_a_new_plan_the_band_grows_with_the_map():
    made = planner()
    made.plan(view(), ahead((8.0, 0.0)))
    assert made._local_planner.band[-1, 0] == pytest.approx(5.0, abs=3.1)
    pose = Pose(4.0, 0.0, 0.0)
    assert made.plan(view(pose=pose), LOST).v > 0.0
    assert made._local_planner.band[-1, 0] == pytest.approx(8.0)
    assert made._local_planner.band[0, 0] == pytest.approx(4.0)


def test_a_robot_in_a_forbidden_cell_stops_and_turns_only_where_its_footprint_is_free():
    made = planner()
    made.plan(view(), ahead((6.0, 0.0)))
    beside = World(segments=np.array([[-2.0, -0.2, 2.0, -0.2]]))
    for _ in range(round(20.0 * JACKAL.control_rate)):
        assert made.plan(view(beside, twist=Twist(0.0, 0.0)), LOST) == (0.0, 0.0)
