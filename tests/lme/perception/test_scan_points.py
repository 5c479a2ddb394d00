import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.fan import diamond
from lme.perception.raycast import cast_shapes
from lme.perception.scan_points import beam_directions, scan_points
from tests import oracles
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
AT_BASE = (0.0, 0.0, 0.0)


@given(SEEDS)
def test_equals_moving_and_sorting_with_numpy(seed):
    rng = np.random.default_rng(seed)
    num_beams = int(rng.integers(1, 200))
    ranges = rng.uniform(0, 12, num_beams).astype(np.float32)
    ranges[rng.random(num_beams) < 0.1] = rng.choice([np.nan, np.inf, -np.inf, 0.0, 10.0])
    increment = rng.choice([-1, 1]) * 2 * math.pi / num_beams * rng.choice([1.0, 0.7])
    directions = beam_directions(rng.uniform(-7, 7), increment, num_beams)
    mount = tuple(rng.uniform(-4, 4, 3))
    points = scan_points(ranges, directions, 0.1, 10.0, mount)
    assert points == pytest.approx(oracles.scan_points(ranges, directions, 0.1, 10.0, mount), abs=KERNEL)


def test_only_beams_with_a_return_become_points():
    ranges = np.array([np.nan, np.inf, -np.inf, 0.0, 0.0999, 0.1, 3.0, 9.999, 10.0, 11.0], dtype=np.float32)
    points = scan_points(ranges, np.tile([1.0, 0.0], (10, 1)), 0.1, 10.0, AT_BASE)
    assert points[:, 0] == pytest.approx(ranges[[5, 6, 7]])


@pytest.mark.parametrize("range_max", [15.1, 5.6, 0.3])  # not float32 numbers
def test_beams_of_the_simulator_that_hit_nothing_make_no_points(range_max):
    angles = (-math.pi, 2 * math.pi / 90, 90)
    ranges = cast_shapes(AT_BASE, angles, range_max, np.empty((0, 3)), np.empty((0, 4)))
    assert len(scan_points(ranges, beam_directions(*angles), 0.0, range_max, AT_BASE)) == 0


def test_an_infinite_range_max_drops_infinite_returns_alone():
    ranges = np.array([1.0, np.inf], dtype=np.float32)
    assert len(scan_points(ranges, np.eye(2), 0.0, math.inf, AT_BASE)) == 1


def test_the_mount_moves_and_turns_the_scan():
    # Beams ahead and left of a lidar at (0.5, 0) that looks left: they hit at (0.5, 2) and (−0.5, 0).
    ranges = np.array([2.0, 1.0], dtype=np.float32)
    points = scan_points(ranges, np.eye(2), 0.0, 10.0, (0.5, 0.0, math.pi / 2))
    assert points == pytest.approx(np.array([[0.5, 2.0], [-0.5, 0.0]]), abs=KERNEL)


def test_equal_bearings_stay_in_the_order_of_the_beams():
    ranges = np.array([3.0, 1.0, 2.0], dtype=np.float32)
    points = scan_points(ranges, np.tile([0.0, 1.0], (3, 1)), 0.0, 10.0, AT_BASE)
    assert points[:, 1].tolist() == [3.0, 1.0, 2.0]


def test_straight_behind_counts_as_plus_pi():
    directions = np.array([[-1.0, -0.0], [0.0, -1.0], [1.0, 0.0]])
    points = scan_points(np.ones(3, dtype=np.float32), directions, 0.0, 10.0, AT_BASE)
    assert points[:, 0].tolist() == [0.0, 1.0, -1.0]


def test_no_beams_give_no_points():
    assert scan_points(np.empty(0, np.float32), np.empty((0, 2)), 0.0, 10.0, AT_BASE).shape == (0, 2)


def test_directions_are_those_of_the_beams():
    # A quarter turn in three: −45°, 0°, 45°.
    half = math.sqrt(0.5)
    assert beam_directions(-math.pi / 4, math.pi / 4, 3) == pytest.approx(
        np.array([[half, -half], [1.0, 0.0], [half, half]]), abs=KERNEL
    )


def test_diamond_angles_rise_with_the_bearing():
    bearings = np.linspace(-math.pi, math.pi, 10_001)[1:]
    diamonds = [diamond(7 * math.cos(a), 7 * math.sin(a)) for a in bearings]
    assert (np.diff(diamonds) > 0).all()
    assert diamond(0.0, 0.0) == 0.0
    assert diamond(-3.0, 0.0) == 2.0
