"""Remembered points: what a scan sees again is replaced, what it cannot see is kept."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.frames import to_robot, to_world
from lme.guides.lme_plus.memory import remember, squares_around
from lme.types import Pose
from tests import oracles
from tests.tolerances import KERNEL

HERE = Pose(0.0, 0.0, 0.0)
NOTHING = np.empty((0, 2))
SLACK, RANGE_MAX = 0.15, 15.0


def kept(
    memory,
    ranges,
    points=NOTHING,
    first=-math.pi,
    increment=None,
    mount=HERE,
    pose=HERE,
    square=0.05,
    reach=8.0,
    range_max=RANGE_MAX,
):
    """What is remembered of `memory`, and of the scan's `points`; the beams go all around unless told."""
    memory, points = (np.array(each, dtype=float).reshape(-1, 2) for each in (memory, points))
    beams = first, 2 * math.pi / len(ranges) if increment is None else increment
    ranges = np.asarray(ranges, dtype=np.float32)
    taken = squares_around(reach, square)
    return remember(taken, memory, points, ranges, beams, mount, pose, square, reach, SLACK, range_max)[0]


@given(st.integers(0, 10**6), st.booleans(), st.booleans())
def test_carried_points_agree_with_the_slow_twin(seed, full_circle, clockwise):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 90))
    fov = 2 * math.pi if full_circle else rng.uniform(0.5, 5.5)
    increment = fov / count * (-1 if clockwise else 1)
    mount = Pose(*rng.uniform(-0.3, 0.3, 2), rng.uniform(-3, 3))
    pose = Pose(*rng.uniform(-20.0, 20.0, 2), rng.uniform(-9, 9))
    ranges = rng.choice([0.5, 2.0, 5.0, 15.0, np.nan, np.inf, 0.0], count).astype(np.float32)
    ranges = ranges * rng.uniform(0.8, 1.2, count).astype(np.float32)
    memory, points = rng.uniform(-4, 4, (60, 2)) + pose[:2], rng.uniform(-4, 4, (30, 2))
    given_ = (
        memory,
        points,
        ranges,
        (rng.uniform(-4, 4), increment),
        mount,
        pose,
        rng.uniform(0.05, 1.0),
        3.5,
        SLACK,
        rng.choice([2.0, 3.0, RANGE_MAX]),
    )
    taken = squares_around(*given_[-3:-5:-1])
    kept_, around = remember(taken, *given_)
    np.testing.assert_allclose(kept_, oracles.remember(*given_), rtol=0, atol=KERNEL)
    np.testing.assert_allclose(around, to_robot(kept_, pose), rtol=0, atol=KERNEL)
    assert not taken.any()


def test_points_that_a_beam_passed_are_gone_and_those_behind_an_obstacle_stay():
    ranges = np.full(360, 15.0)
    ranges[150:211] = 2.0  # a wall ahead, 2 m away
    hidden, passed = [[3.0, 0.0], [2.2, 0.1]], [[1.0, 0.0], [0.0, 3.0], [-3.0, 0.0]]
    assert kept(hidden + passed, ranges).tolist() == hidden
    assert (
        kept([[2.1, 0.0]], ranges).tolist() == []
    )  # nearer behind the surface than the slack: the surface itself


def test_a_beams_neighbours_must_see_past_a_point_too():
    ranges = np.full(360, 15.0)
    ranges[181] = 2.0
    assert len(kept([[3.0, 0.0]], ranges)) == 1
    ranges[180:183] = [15.0, 15.0, 2.0]
    assert len(kept([[3.0, 0.0]], ranges)) == 0


@pytest.mark.parametrize("sense", [1, -1])
def test_points_in_the_blind_arc_stay(sense):
    fov = 1.5 * math.pi
    ranges = np.full(271, 15.0)
    behind, beside = [[-2.0, 0.0], [-2.0, 1.9], [-2.0, -1.9]], [[-1.8, 2.0], [-1.8, -2.0]]
    some = kept(behind + beside, ranges, first=-sense * fov / 2, increment=sense * fov / 270)
    assert some.tolist() == behind


@pytest.mark.parametrize("unseen", [np.nan, 0.0])
def test_an_invalid_beam_clears_no_point_but_one_without_a_return_does(unseen):
    assert len(kept([[2.0, 0.0]], np.full(360, unseen))) == 1
    assert len(kept([[2.0, 0.0]], np.full(360, np.inf))) == 0


def test_no_return_says_nothing_of_points_that_are_out_of_range():
    assert kept([[4.8, 0.0], [4.9, 0.0], [5.2, 0.0]], np.full(360, np.inf), range_max=5.0).tolist() == [
        [4.9, 0.0],
        [5.2, 0.0],
    ]


def test_far_points_are_forgotten_and_those_of_the_scan_left_out():
    blind = np.zeros(8)
    memory, scan = [[7.9, 0.0], [8.1, 0.0]], [[0.0, 7.9], [0.0, 8.1]]
    assert kept(memory, blind, scan).tolist() == [[0.0, 7.9], [7.9, 0.0]]


def test_one_point_stays_per_square_and_the_scan_wins():
    memory, scan = [[1.01, 0.01], [1.02, 0.02], [1.06, 0.01]], [[1.03, 0.03], [1.04, 0.04]]
    assert kept(memory, np.zeros(8), scan).tolist() == [[1.03, 0.03], [1.06, 0.01]]


def test_points_lie_in_the_carried_frame():
    pose = Pose(10.0, -3.0, 2.0)
    scan = np.array([[1.0, 0.5], [-2.0, 0.3]])
    found = kept(NOTHING, np.zeros(8), scan, pose=pose)
    np.testing.assert_allclose(found, to_world(scan, pose), atol=KERNEL)
