"""Learned times: they only rise, stay with their places as the array grows, and are least times of later searches."""

import math
from unittest.mock import patch

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.guides.lme_plus.learned_times import OTHER_TARGET, LearnedTimes
from lme.guides.lme_plus.travel import Travel
from lme.guides.lme_plus.travel_grid import Grid
from tests import oracles
from tests.builders import stage
from tests.tolerances import KERNEL

CELL, SIZE = 0.5, 10
GRID = Grid(0.0, 0.0, CELL, SIZE)
DISC = np.pad(oracles.disc(SIZE)[0], 1)
HERE, V_MAX = np.array([2.0, 2.6]), 0.5


def times_of(learned, grid):
    """A copy of the learned times of a grid and its frame."""
    times, (i, j) = learned.around(grid)
    return times[i : i + grid.size + 2, j : j + grid.size + 2].copy()


def learn(learned, found, here=HERE, target=HERE, most=20.0):
    learned.learn(found, GRID, here, target, most, V_MAX)


def straight(target):
    """The time of the straight way from each cell [s]."""
    nothing = np.full(DISC.shape, np.inf)
    return -oracles.least_times(nothing, GRID, target, 0.0, V_MAX)


@given(st.integers(0, 10**6))
def test_a_cell_of_the_disc_has_the_greatest_of_all_least_times_that_exceed_the_straight_way(seed):
    rng, learned, slow = np.random.default_rng(seed), LearnedTimes(), np.zeros((SIZE + 2, SIZE + 2))
    first = rng.uniform(-5.0, 10.0, 2)
    for _ in range(3):
        here, target = rng.uniform(0.0, 5.0, 2), moved(first, rng)
        most = math.dist(here, target) / V_MAX + rng.uniform(0.0, 8.0)
        found = np.where(rng.random(DISC.shape) < 0.5, rng.uniform(0.0, most, DISC.shape), np.inf)
        learn(learned, found, here, target, most)
        slow = np.where(DISC, np.maximum(slow, oracles.least_times(found, GRID, here, most, V_MAX)), slow)
    fast, least = times_of(learned, GRID), straight(moved(first, rng))
    np.testing.assert_allclose(np.maximum(fast, least), np.maximum(slow, least), rtol=0.0, atol=KERNEL)


def moved(target, rng):
    """Where the target may be later without being another one."""
    away, bearing = rng.uniform(0.0, OTHER_TARGET), rng.uniform(0.0, 2 * math.pi)
    return target + away * np.array([math.cos(bearing), math.sin(bearing)])


def test_cells_far_from_the_way_to_the_target_are_left_out():
    learned = LearnedTimes()
    learn(learned, np.full(DISC.shape, np.inf), np.array([0.5, 0.5]), np.array([0.5, 4.5]), 8.0)
    assert times_of(learned, GRID)[2, 4] > 0.0
    assert times_of(learned, GRID)[8, 4] == 0.0


def test_times_stay_with_their_places_wherever_the_robot_goes():
    learned = LearnedTimes()
    learn(learned, np.where(DISC, 7.0, np.inf))
    before = times_of(learned, GRID)
    for x, y in ((2.0, 0.0), (-40.0, 3.5), (-40.0, 90.0), (55.0, -30.5)):
        assert not times_of(learned, GRID._replace(x=x + 100.0, y=y)).any()
        np.testing.assert_array_equal(times_of(learned, GRID), before)
    shifted = times_of(learned, GRID._replace(x=CELL, y=-2 * CELL))
    np.testing.assert_array_equal(shifted[:-1, 2:], before[1:, :-2])


@given(st.integers(0, 10**6))
def test_no_learned_time_is_longer_than_a_search_of_all_ways_finds(seed):
    rng, robot, learned = np.random.default_rng(seed), stage(), LearnedTimes()
    points, here, target = (
        rng.uniform(-3.5, 3.5, (12, 2)),
        rng.uniform(-0.5, 0.5, 2),
        rng.uniform(-6.0, 6.0, 2),
    )
    points = points[np.hypot(*(points - here).T) > 0.8]
    field = Travel(load_settings("guide/lme_plus").travel, robot, 4.0, 0.08).field(
        points, target, here, learned=learned
    )
    with patch("lme.guides.lme_plus.travel.BEYOND", 1e3):
        exact = (
            Travel(load_settings("guide/lme_plus").travel, robot, 4.0, 0.08).field(points, target, here).times
        )
    assert times_of(learned, field.grid).any() == math.isfinite(field.robot_time)
    assert (times_of(learned, field.grid) <= exact + field.grid.cell / robot.v_max).all()


def test_people_teach_nothing():
    travel, target = Travel(load_settings("guide/lme_plus").travel, stage(), 4.0, 0.08), np.array([9.0, 0.0])
    learned, somebody = LearnedTimes(), np.array([[2.0, 0.0, 0.0, 0.0, 0.3, 5.0]])
    field = travel.field(np.empty((0, 2)), target, np.zeros(2), somebody, learned)
    assert not times_of(learned, field.grid).any()
