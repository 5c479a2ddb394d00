import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from lme.guides.global_path.kernels import departs, nearest_passable, search, straighten, trace
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
WALL = 255
EVEN = np.where(np.arange(256) < WALL, 1.0, np.inf)  # every cell the same, or a wall


def scene(seed, side=25, walls=0.25):
    """Costs with walls in them, a table in which no two ways cost the same, a free start and a free goal."""
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, WALL, rng.integers(3, side, 2)).astype(np.uint8)
    costs[rng.random(costs.shape) < rng.uniform(0, walls)] = WALL
    table = np.append(rng.uniform(1, 5, WALL), np.inf)
    ends = [tuple(int(rng.integers(n)) for n in costs.shape) for _ in range(2)]
    for end in ends:
        costs[end] = 0
    return costs, table, *ends


def moves(costs, table):
    """Every move and its cost, looked at one by one."""
    weight = table[costs]
    for (i, j), here in np.ndenumerate(weight):
        for di, dj in [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]:
            a, b = i + di, j + dj
            if not (0 <= a < weight.shape[0] and 0 <= b < weight.shape[1]):
                continue
            if np.isfinite([here, weight[a, b], weight[i, b], weight[a, j]]).all() or (
                0 in (di, dj) and np.isfinite(here + weight[a, b])
            ):
                yield (i, j), (a, b), math.hypot(di, dj) * (here + weight[a, b]) / 2


def cheapest(costs, table, start):
    """scipy's Dijkstra on the graph of all moves."""
    rows = [(np.ravel_multi_index(a, costs.shape), np.ravel_multi_index(b, costs.shape), c)
            for a, b, c in moves(costs, table)]  # fmt: skip
    a, b, c = np.array(rows).reshape(-1, 3).T
    graph = coo_array((c, (a.astype(int), b.astype(int))), shape=(costs.size, costs.size)).tocsr()
    return dijkstra(graph, indices=np.ravel_multi_index(start, costs.shape)).reshape(costs.shape)


@given(SEEDS, st.floats(0, 1))
def test_dijkstra_and_a_star_both_find_the_costs_of_scipy(seed, weight):
    costs, table, start, goal = scene(seed)
    wanted = cheapest(costs, table, start)
    g = search(costs, table, start, goal, weight)
    assert g[goal] == pytest.approx(wanted[goal], rel=KERNEL)
    if weight == 0.0:
        nearer = wanted < wanted[goal]
        assert g[nearer] == pytest.approx(wanted[nearer], rel=KERNEL)


@given(SEEDS, st.sampled_from([0.0, 1.0]))
def test_the_path_is_made_of_allowed_moves_and_costs_what_was_found(seed, weight):
    costs, table, start, goal = scene(seed)
    g = search(costs, table, start, goal, weight)
    path = [tuple(cell) for cell in trace(g, costs, table, start, goal).tolist()]
    if np.isinf(g[goal]):
        assert path == []
        return
    allowed = {(a, b): cost for a, b, cost in moves(costs, table)}
    assert (path[0], path[-1]) == (start, goal)
    assert sum(allowed[move] for move in pairwise(path)) == pytest.approx(g[goal], rel=KERNEL)


@given(SEEDS, st.sampled_from([0.0, 1.0]))
def test_a_mirrored_grid_gives_the_mirrored_path(seed, weight):
    costs, table, start, goal = scene(seed)
    across = costs.shape[1] - 1
    path = found(costs, table, start, goal, weight)
    mirrored = found(
        np.ascontiguousarray(costs[:, ::-1]),
        table,
        (start[0], across - start[1]),
        (goal[0], across - goal[1]),
        weight,
    )
    assert mirrored.tolist() == [[i, across - j] for i, j in path.tolist()]


def found(costs, table, start, goal, weight=1.0):
    """The straightened path."""
    g = search(costs, table, start, goal, weight)
    path = trace(g, costs, table, start, goal)
    return straighten(path, g, costs, table) if len(path) else path


def test_a_star_looks_at_fewer_cells():
    costs = np.zeros((61, 61), np.uint8)
    looked_at = [np.isfinite(search(costs, EVEN, (30, 10), (30, 50), weight)).sum() for weight in (0.0, 1.0)]
    assert looked_at[1] < looked_at[0] / 5


def test_from_a_cell_to_itself():
    costs = np.zeros((3, 3), np.uint8)
    assert found(costs, EVEN, (1, 1), (1, 1)).tolist() == [[1, 1]]


@given(st.tuples(*[st.integers(0, 40)] * 4))
def test_free_ground_is_crossed_in_a_straight_line(ends):
    start, goal = ends[:2], ends[2:]
    path = found(np.zeros((41, 41), np.uint8), EVEN, start, goal)
    assert path.tolist() == ([list(start), list(goal)] if start != goal else [list(start)])


@given(SEEDS)
def test_straight_pieces_join_cells_of_the_path_and_cost_no_more(seed):
    costs, table, start, goal = scene(seed, walls=0.1)
    table[:WALL] = 1.0 + (table[:WALL] - 1.0) * 0.02  # so even that lines do pay
    g = search(costs, table, start, goal, 1.0)
    path = trace(g, costs, table, start, goal)
    corners = straighten(path, g, costs, table) if len(path) else path
    places = [path.tolist().index(corner) for corner in corners.tolist()]
    assert places == sorted(set(places))
    if len(path):
        assert (places[0], places[-1]) == (0, len(path) - 1)
    for a, b in pairwise(corners):
        if np.abs(b - a).max() > 1:  # more than a move of the path
            assert line_cost(costs, table, a, b) <= (g[tuple(b)] - g[tuple(a)]) * (1 + KERNEL)


def line_cost(costs, table, a, b):
    """Trapezoids between samples at least twice a cell."""
    pieces = math.ceil(2 * math.dist(a, b))
    along = np.linspace(0, 1, pieces + 1)[:, None]
    offset = np.sign(b - a) * np.floor(np.abs(b - a) * np.arange(pieces + 1)[:, None] / pieces + 0.5)
    i, j = (a + offset).astype(int).T
    return np.trapezoid(table[costs[i, j]], along[:, 0] * math.dist(a, b))


@settings(max_examples=200)
@given(SEEDS)
def test_nearest_passable_cell_of_all(seed):
    costs, table, cell, towards = scene(seed, side=12, walls=1.3)
    costs[cell] = costs[towards] = WALL
    free = np.argwhere(table[costs] < np.inf)
    if len(free) == 0:
        assert nearest_passable(costs, table, cell, towards) == (-1, -1)
        return
    wanted = min((((f - cell) ** 2).sum(), ((f - towards) ** 2).sum()) for f in free)
    one = np.array(nearest_passable(costs, table, cell, towards))
    assert one.tolist() in free.tolist()
    assert (((one - cell) ** 2).sum(), ((one - towards) ** 2).sum()) == wanted


@settings(max_examples=200)
@given(SEEDS)
def test_departs_looks_at_every_pair(seed):
    rng = np.random.default_rng(seed)
    path, other = (rng.uniform(0, 1, (rng.integers(1, 12), 2)) for _ in range(2))
    gaps = np.linalg.norm(path[:, None] - other[None], axis=2).min(axis=1)
    for limit in (gaps.max() * 0.999, gaps.max() * 1.001):
        assert departs(path, other, limit) == (gaps > limit).any()
