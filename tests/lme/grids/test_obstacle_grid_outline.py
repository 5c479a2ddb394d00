import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.grids.obstacle_grid import covered_cells, free_covered, outline_capacity, outline_cells, outline_cost
from tests import oracles
from tests.builders import shipped

SEEDS = st.integers(0, 2**32 - 1)
SHAPE = (61, 61)
GRID = (-30, -30, 0.05)
BOX = shipped("jackal").footprint.outline(0.1)


def drawn(seed):
    """A footprint, of a rectangle or of a disc, and a pose that keeps it on the grid."""
    rng = np.random.default_rng(seed)
    name = ("jackal", "stage", "go2")[rng.integers(3)]
    outline = shipped(name).footprint.outline(rng.uniform(0.0, 0.1))
    return rng, outline, (*rng.uniform(-0.7, 0.7, 2), rng.uniform(-4.0, 4.0))


def listed(outline, pose, shape=SHAPE):
    cells = np.full(outline_capacity(outline, GRID[2]), -7)
    count = outline_cells(outline, pose, GRID, shape, cells)
    return {divmod(int(cell), shape[1]) for cell in cells[:count]}


@given(SEEDS)
def test_outline_cells_agree_with_their_slow_twin(seed):
    _, outline, pose = drawn(seed)
    assert listed(outline, pose) == oracles.outline_cells(outline, pose, GRID)


@given(SEEDS)
def test_covered_cells_agree_with_the_slow_twin_and_hold_the_whole_outline(seed):
    rng, outline, pose = drawn(seed)
    covered = covered_cells(outline, pose, GRID, SHAPE)
    np.testing.assert_array_equal(covered, oracles.covered_cells(outline, pose, GRID, SHAPE))
    inside = rng.dirichlet(np.ones(len(outline)), 50) @ outline * 0.8  # a cell inside the outline
    for point in oracles.outwards(pose, inside):
        assert covered[oracles.cell_of(point, GRID)]


@given(SEEDS)
def test_the_cost_is_the_highest_under_the_outline(seed):
    rng, outline, pose = drawn(seed)
    costs = rng.integers(0, 254, SHAPE).astype(np.uint8)
    cells = np.empty(outline_capacity(outline, GRID[2]), np.int64)
    under = sorted(oracles.outline_cells(outline, pose, GRID))
    assert outline_cost(costs, outline, pose, GRID, cells) == max(costs[cell] for cell in under)
    costs[under[rng.integers(len(under))]] = 254
    assert outline_cost(costs, outline, pose, GRID, cells) == -1


@pytest.mark.parametrize("centre", [(-1.4, 0.0), (0.0, 1.4), (5.0, 5.0), (-1.4, -1.4)])
def test_a_footprint_that_leaves_the_map_is_invalid(centre):
    cells = np.empty(outline_capacity(BOX, GRID[2]), np.int64)
    assert outline_cells(BOX, (*centre, 0.3), GRID, SHAPE, cells) == -1
    assert outline_cost(np.zeros(SHAPE, np.uint8), BOX, (*centre, 0.3), GRID, cells) == -1
    assert not covered_cells(BOX, (*centre, 0.3), GRID, SHAPE).any()


def test_the_robot_frees_where_it_stands_and_nothing_else():
    hits = np.ones(SHAPE, np.int32)
    pose = (0.2, -0.1, math.pi / 3)
    free_covered(hits, BOX, pose, GRID)
    np.testing.assert_array_equal(hits == 0, covered_cells(BOX, pose, GRID, SHAPE))
