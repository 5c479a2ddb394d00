import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.planners.ros_dwa.kernels import HITS, LOST, distances, score, way_cells
from lme.types import Pose, Twist
from tests import oracles
from tests.builders import shipped
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
SHAPE = (81, 81)
GRID = (-40, -40, 0.05)
EVERYWHERE = (0, SHAPE[0], 0, SHAPE[1])
OUTLINE = shipped("jackal").footprint.outline(0.1)
SCALES = (0.75, 1.0, 0.1)
ALPHAS = (10.0, 20.0)
SIMULATION = (2.0, 0.02, 0.02)


def drawn(seed, share=0.3):
    """A generator, and costs of which about this share forbid."""
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random(SHAPE) < share, rng.integers(253, 255, SHAPE), rng.integers(0, 253, SHAPE))
    return rng, costs.astype(np.uint8)


@given(SEEDS)
def test_distances_are_the_slow_twin(seed):
    rng, costs = drawn(seed)
    ignored, cells = rng.random(SHAPE) < 0.1, rng.integers(0, 81, (rng.integers(0, 4), 2))
    found = distances(costs, ignored, cells, EVERYWHERE)
    expected = oracles.grid_distances((costs < 253) | ignored, cells)
    np.testing.assert_array_equal(np.maximum(found, -1), expected)


@given(SEEDS)
def test_distances_in_the_window_are_those_without_one(seed):
    rng, costs = drawn(seed, 0.1)
    ignored, cells = np.zeros(SHAPE, np.bool_), rng.integers(0, 81, (1, 2))
    i, j = np.sort(rng.integers(-5, 90, 2)), np.sort(rng.integers(-5, 90, 2))
    whole, part = (distances(costs, ignored, cells, window) for window in (EVERYWHERE, (*i, *j)))
    inside = slice(max(i[0], 0), max(i[1], 0)), slice(max(j[0], 0), max(j[1], 0))
    np.testing.assert_array_equal(np.maximum(whole[inside], -1), np.maximum(part[inside], -1))


def test_the_way_ends_where_it_leaves_the_map_and_begins_where_it_enters():
    path = np.column_stack([np.arange(-3.0, 3.0, 0.05), np.zeros(120)])
    cells = way_cells(path, (0.0, 0.0), 1.01, GRID, SHAPE)
    assert cells[0].tolist() == [20, 40]
    assert cells[-1].tolist() == [60, 40]
    back = np.vstack([path, path[::-1]])
    assert len(way_cells(back, (0.0, 0.0), 1.01, GRID, SHAPE)) == len(cells)
    assert len(way_cells(path, (0.0, 9.0), 1.0, GRID, SHAPE)) == 0


def scene(seed):
    """A generator, and what `score` needs: a few obstacles about a robot that moves."""
    rng = np.random.default_rng(seed)
    costs = np.zeros(SHAPE, np.uint8)
    for i, j in rng.integers(0, 81, (rng.integers(0, 12), 2)):
        if np.hypot(i - 40, j - 40) > 9:
            costs[max(i - 5, 0) : i + 6, max(j - 5, 0) : j + 6] = 253
            costs[i, j] = 254
    pose = Pose(*rng.uniform(-0.05, 0.05, 2).tolist(), rng.uniform(-4, 4))
    twist = Twist(*rng.uniform(-0.5, 0.5, 2).tolist())
    nothing = np.zeros(SHAPE, np.bool_)
    to_path, to_goal = (distances(costs, nothing, rng.integers(20, 61, (1, 2)), EVERYWHERE) for _ in range(2))
    wanted = np.column_stack([rng.choice([-0.5, 0.0, 0.1, 0.3, 0.5], 25), rng.uniform(-1.57, 1.57, 25)])
    return wanted, (pose, twist, ALPHAS, SIMULATION, OUTLINE, costs, GRID, to_path, to_goal, SCALES)


@given(SEEDS)
def test_scores_are_the_slow_twin(seed):
    wanted, view = scene(seed)
    scores, ends = score(wanted, *view, np.inf, False)
    for n, twist in enumerate(wanted[:6]):
        expected, end = oracles.trajectory_score(twist, *view)
        assert scores[n] == pytest.approx(expected, abs=KERNEL)
        if expected >= 0.0:
            assert ends[n] == pytest.approx(end, abs=KERNEL)


@given(SEEDS, st.floats(0.0, 150.0))
def test_twists_that_are_not_scored_are_worse(seed, least):
    wanted, view = scene(seed)
    whole, _ = score(wanted, *view, np.inf, False)
    valid = np.where(whole >= 0.0, whole, np.inf)
    some, _ = score(wanted, *view, least, False)
    kept = valid <= least
    np.testing.assert_array_equal(some[kept], whole[kept])
    assert ((some[~kept] < 0.0) | (some[~kept] > least)).all()
    best, _ = score(wanted, *view, np.inf, True)
    best = np.where(best >= 0.0, best, np.inf)
    assert best.min() == valid.min()
    np.testing.assert_array_equal(np.flatnonzero(best == best.min()), np.flatnonzero(valid == valid.min()))


def test_an_obstacle_ahead_is_hit_and_a_cell_without_a_way_is_lost():
    costs = np.zeros(SHAPE, np.uint8)
    ahead = np.array([[0.5, 0.0]])
    nothing, goal = np.zeros(SHAPE, np.bool_), np.array([[60, 40]])
    costs[54, 40] = 254  # 0.7 m ahead
    way = distances(costs, nothing, goal, EVERYWHERE)
    view = (
        (0.0, 0.0, 0.0),
        (0.5, 0.0),
        ALPHAS,
        SIMULATION,
        OUTLINE,
        costs,
        GRID,
        way,
        way,
        SCALES,
        np.inf,
        False,
    )
    assert score(ahead, *view)[0].tolist() == [HITS]
    costs[:] = 0
    costs[54, :] = 253
    way = distances(costs, nothing, goal, EVERYWHERE)
    view = (*view[:5], costs, GRID, way, way, SCALES, np.inf, False)
    assert score(ahead, *view)[0].tolist() == [LOST]
