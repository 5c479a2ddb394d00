"""Remembered points: what a scan sees again is replaced, what it cannot see is kept."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.frames import to_robot
from lme.guides.lme_plus.memory import remember, squares_around
from lme.types import Pose
from tests import oracles
from tests.tolerances import KERNEL

HERE = (0.0, 0.0, 0.0)
NOTHING = np.empty((0, 2))
SLACK, RANGE_MAX = 0.15, 15.0


def kept(memory, ranges):
    """What is remembered of `memory` by a robot at the origin; the beams go all around."""
    ranges, beams = np.asarray(ranges, dtype=np.float32), (-math.pi, 2 * math.pi / len(ranges))
    scan = np.array(memory), NOTHING, ranges, beams, HERE, HERE
    return remember(squares_around(8.0, 0.05), *scan, 0.05, 8.0, SLACK, RANGE_MAX)[0]


@given(st.integers(0, 10**6), st.booleans(), st.booleans())
def test_carried_points_agree_with_the_slow_twin(seed, full_circle, clockwise):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 90))
    fov = 2 * math.pi if full_circle else rng.uniform(0.5, 5.5)
    increment = fov / count * (-1 if clockwise else 1)
    mount = (*rng.uniform(-0.3, 0.3, 2).tolist(), rng.uniform(-3, 3))
    pose = (*rng.uniform(-20.0, 20.0, 2).tolist(), rng.uniform(-9, 9))
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
    np.testing.assert_allclose(around, to_robot(kept_, Pose(*pose)), rtol=0, atol=KERNEL)
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
