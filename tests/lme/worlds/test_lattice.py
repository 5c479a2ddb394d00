"""Shortest paths on a lattice, against SciPy's Dijkstra on a graph of all moves."""

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from lme.worlds.lattice import shortest_path

DIRECTIONS = [(0, 1), (1, 1), (1, 2), (1, 3), (2, 3)]


def beside(rows, columns):
    """The points on both sides of the line to a point at most as many rows as columns away."""
    if (rows, columns) == (1, 1):
        return [(0, 1), (1, 0)]
    shares = [(step, step * rows / columns) for step in range(1, columns)]
    return [(side, step) for step, share in shares for side in (math.floor(share), math.ceil(share))]


def all_moves():
    for rows, columns in DIRECTIONS:
        points = [(rows, columns), *beside(rows, columns)]
        for a in (1, -1):
            for b in (1, -1):
                yield [(a * row, b * column) for row, column in points]
                yield [(a * column, b * row) for row, column in points]


def graph(free, step):
    def is_free(row, column):
        return 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and free[row, column]

    found = {}
    for row, column in np.argwhere(free):
        for move in all_moves():
            if all(is_free(row + a, column + b) for a, b in move):
                ends = (
                    row * free.shape[1] + column,
                    (row + move[0][0]) * free.shape[1] + column + move[0][1],
                )
                found[ends] = math.hypot(*move[0]) * step
    starts, ends = np.array(list(found)).T
    return coo_array((list(found.values()), (starts, ends)), shape=(free.size, free.size)).tocsr()


@pytest.mark.parametrize("seed", range(6))
def test_lengths_are_those_of_dijkstra_to_the_last_bit(seed):
    rng = np.random.default_rng(seed)
    free = rng.random((18, 25)) > 0.1 + 0.05 * seed
    points = np.argwhere(free)
    start = points[rng.integers(len(points))]
    lengths = dijkstra(graph(free, 0.05), indices=start[0] * free.shape[1] + start[1])
    assert np.isfinite(lengths).sum() > 1
    for goal in points:
        expected = lengths[goal[0] * free.shape[1] + goal[1]]
        assert shortest_path(free, 0.05, start, goal) == expected


def test_a_path_does_not_squeeze_between_points_that_touch_diagonally():
    free = np.ones((6, 6), dtype=bool)
    free[:3, 3:] = free[3:, :3] = False
    ends = np.array([0, 0]), np.array([5, 5])
    assert shortest_path(free, 1.0, *ends) == math.inf
    free[3, 2] = True
    assert shortest_path(free, 1.0, *ends) == pytest.approx(2 * math.hypot(2, 3))


def test_a_search_may_go_all_over_a_large_lattice():
    """A wall between start and goal, open at its end: the heap grows many times."""
    free = np.ones((700, 900), dtype=bool)
    free[:-4, 450] = False
    length = shortest_path(free, 0.1, np.array([0, 440]), np.array([0, 460]))
    straight = math.hypot(697, 10) + math.hypot(697, 10)
    assert straight * 0.1 <= length <= straight * 0.1 * 1.014
