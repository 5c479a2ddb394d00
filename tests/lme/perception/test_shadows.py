"""Returns between two surfaces are dropped, and nothing else is."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.perception.raycast import cast
from lme.perception.resampling import resampled, tidied
from lme.perception.shadows import without_shadows
from lme.robots import Lidar
from lme.types import LaserScan, Pose

ANGLE = math.radians(10.0)
CENTRE = Pose(0.0, 0.0, 0.0)


def scan(ranges, increment=0.01, angle_min=-0.02):
    return LaserScan(np.array(ranges, np.float32), angle_min, increment, 0.1, 10.0)


def dropped(ranges, **keys):
    return np.flatnonzero(np.isnan(without_shadows(scan(ranges, **keys), ANGLE).ranges)).tolist()


def test_a_return_in_mid_air_is_dropped_and_the_edges_of_both_surfaces_stay():
    assert dropped([1.0, 1.0, 2.0, 3.0, 3.0]) == [2]
    assert dropped([3.0, 3.0, 2.0, 1.0, 1.0]) == [2]
    assert dropped([1.0, 1.0, 1.6, 2.3, 3.0, 3.0]) == [2, 3]


@pytest.mark.parametrize(
    "ranges",
    [
        [1.0, 1.0, 3.0, 3.0, 3.0],  # a plain edge
        [3.0, 3.0, 1.0, 3.0, 3.0],  # a thin post
        [1.0, 1.0, 3.0, 1.0, 1.0],  # a gap
        [1.0, 1.001, 1.002, 1.003, 1.004],  # a wall at an angle
        [1.0, 1.0, 2.0, math.inf, math.inf],  # the neighbour has no return
        [1.0, 1.0, 2.0, math.nan, 3.0],
        [1.0, 1.0, 2.0, 10.0, 10.0],
        [0.05, 0.05, 2.0, 3.0, 3.0],
    ],
)
def test_what_else_looks_like_an_edge_stays(ranges):
    before = np.array(ranges, np.float32)
    np.testing.assert_array_equal(without_shadows(scan(ranges), ANGLE).ranges, before)


def test_the_first_and_last_beam_are_neighbours_in_a_full_circle_only():
    ranges = [2.0, 3.0, 3.0, 3.0, *[1.0] * 624]
    assert dropped(ranges, increment=math.tau / 628, angle_min=-math.pi) == [0]
    assert dropped(ranges, increment=0.005, angle_min=-1.57) == []


@given(st.floats(0.3, 4.0), st.floats(0.2, math.pi - 0.2), st.sampled_from([90, 360, 720]))
def test_a_wall_is_dropped_only_where_it_is_seen_at_less_than_the_angle(distance, turn, beams):
    lidar = Lidar(beams, math.tau, 0.1, 30.0)
    normal = np.array([math.cos(turn), math.sin(turn)])
    along = np.array([-normal[1], normal[0]])
    ends = [*(distance * normal - 100.0 * along), *(distance * normal + 100.0 * along)]
    wall = cast(lidar, CENTRE, segments=[ends])
    bearings = wall.angle_min + wall.angle_increment * np.arange(beams)
    incidence = np.abs(np.abs(np.remainder(bearings - turn, math.tau) - math.pi) - math.pi / 2)
    kept = without_shadows(wall, ANGLE).ranges
    is_steep = incidence > ANGLE + math.tau / beams
    np.testing.assert_array_equal(kept[is_steep], wall.ranges[is_steep])


def test_the_points_that_an_interpolation_invents_are_dropped():
    lidar = Lidar(270, 1.5 * math.pi, 0.1, 12.0, native_beams=540)
    box = [[2.0, y, 2.0, y + 0.13] for y in np.arange(-1.0, 1.0, 0.31)] + [[5.0, -9.0, 5.0, 9.0]]
    fired = cast(lidar.native, CENTRE, segments=box)
    made = resampled(tidied(fired), lidar.mount, lidar)
    bearings = made.angle_min + made.angle_increment * np.arange(270)
    x = made.ranges * np.cos(bearings)
    is_invented = (x > 2.1) & (x < 4.9)
    assert is_invented.sum() > 3
    kept = without_shadows(made, ANGLE)
    assert np.isnan(kept.ranges[is_invented]).all()
    assert np.isnan(kept.ranges).sum() == is_invented.sum()


def test_the_scan_itself_is_not_changed():
    given_scan = scan([1.0, 1.0, 2.0, 3.0, 3.0])
    without_shadows(given_scan, ANGLE)
    assert np.isfinite(given_scan.ranges).all()
