"""The band: it begins along the path, goes on from the last solution, begins anew, and passes obstacles."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.teb.band import LocalPath, TimedBand
from lme.types import Limits, Pose, Twist

BOX = (0.21, 0.155, 0.0)
LIMITS = Limits(2.0, 4.0, 20.0, 25.0)
START = Pose(0.0, 0.0, 0.0)
NOTHING = np.empty((0, 2))


def way(length=2.0, yaw=0.0, via=NOTHING):
    xs = np.arange(0.05, length + 0.01, 0.05)
    return LocalPath(np.column_stack([xs, np.zeros(len(xs))]), via, yaw)


REST = Twist(0.0, 0.0)


def optimized(given, points=NOTHING, twist=REST, turn=0.0, **changes):
    band = TimedBand(load_settings("planner/teb", **changes), BOX)
    band.follow(given, START, LIMITS)
    total = band.optimize(given.via, points, twist, LIMITS, turn)
    return band, total


def test_a_free_way_is_driven_straight_at_the_limits():
    band, total = optimized(way(), no_outer_iterations=20)
    speeds = np.hypot(*np.diff(band.poses[:, :2], axis=0).T) / band.times
    assert np.isfinite(total)
    assert band.poses[:, 1] == pytest.approx(0.0, abs=1e-6)
    assert 0.7 < np.median(speeds) < 1.1  # time weighs more than the limit, which the command then keeps
    assert ((band.times > 0.1) & (band.times < 0.5)).all()


def test_the_band_keeps_clear_of_an_obstacle_beside_the_path():
    points = np.array([[1.0, 0.15]])
    band, _ = optimized(way(), points)
    nearest = band.poses[np.abs(band.poses[:, 0] - 1.0).argmin()]
    assert nearest[1] < -0.05
    straight, _ = optimized(way(), points, weight_obstacle=0.0)
    assert straight.poses[:, 1] == pytest.approx(0.0, abs=1e-6)


def test_points_of_the_path_attract_the_band():
    band, _ = optimized(way(via=np.array([[1.0, 0.3]])), weight_viapoint=100.0)
    assert np.hypot(*(band.poses[:, :2] - [1.0, 0.3]).T).min() < 0.1


def test_a_wanted_direction_of_turns_keeps_the_band_from_turning_the_other_way():
    aside = LocalPath(np.linspace([0.05, -0.03], [2.5, -1.5], 50), NOTHING, -0.6)
    turns = {
        side: optimized(aside, turn=side, weight_prefer_rotdir=1e4)[0].command()[1]
        for side in (-1.0, 0.0, 1.0)
    }
    assert turns[-1.0] < -0.5
    assert turns[0.0] < -0.5
    assert turns[1.0] > -0.1


def test_it_goes_on_from_the_last_solution():
    band, _ = optimized(way(), np.array([[1.0, 0.15]]))
    before = band.poses.copy()
    robot = Pose(*(0.4 * before[1] + 0.6 * before[2]).tolist())
    band.follow(way(2.3), robot, LIMITS)
    np.testing.assert_array_equal(band.poses[1:-1], before[3:-1])
    assert tuple(band.poses[0]) == robot
    assert tuple(band.poses[-1]) == pytest.approx((2.3, 0.0, 0.0))
    assert len(band.times) == len(band.poses) - 1


@pytest.mark.parametrize(("length", "yaw"), [(3.1, 0.0), (2.0, 1.6)])
def test_a_goal_that_jumps_gives_a_new_band(length, yaw):
    band, _ = optimized(way(), np.array([[1.0, 0.15]]))
    band.follow(way(length, yaw), START, LIMITS)
    assert (band.poses[:, 1] == 0.0).all()


def test_the_command_is_the_first_motion():
    band = TimedBand(load_settings("planner/teb"), BOX)
    band.poses = np.array([[0.0, 0.0, np.pi / 2], [0.0, -0.1, np.pi / 2 + 0.05], [0.0, -0.2, np.pi / 2]])
    band.times = np.array([0.2, 0.2])
    assert band.command() == pytest.approx((-0.5, 0.25))


def test_a_mirrored_scene_gives_the_mirrored_band():
    bands = []
    for side in (1.0, -1.0):
        points = np.array([[0.7, 0.2 * side], [1.3, -0.3 * side]])
        via = np.array([[1.0, 0.1 * side]])
        bands.append(optimized(way(yaw=0.2 * side, via=via), points, Twist(0.3, 0.2 * side))[0].poses)
    assert bands[1] * [1, -1, -1] == pytest.approx(bands[0], abs=1e-6)
