"""Distances to the nearest points: every cell against every point, and nothing left behind."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.policies.lme_plus.kernels.nearest_points import draw, erase, pad
from tests.tolerances import KERNEL


@settings(max_examples=100)
@given(st.integers(0, 10**6), st.sampled_from([0.2, 0.5, 0.52, 1.7]), st.sampled_from([0.1, 0.15]))
def test_distances_agree_with_those_to_all_points_and_are_erased(seed, comfort, cell):
    rng = np.random.default_rng(seed)
    size, corner, robot = 20, rng.uniform(-5.0, 5.0, 2), rng.uniform(-2.0, 2.0, 2)
    points = corner + rng.uniform(-0.5, size * cell + 0.5, (rng.integers(0, 12), 2))
    inside = np.floor((points - corner) / cell)
    alone = np.unique(inside, axis=0, return_index=True)[1]
    points = points[np.sort(alone)]  # one per cell
    border = pad(comfort, cell)
    squares = np.full((size + 2 * border, size + 2 * border), np.inf)
    taken, marks = np.zeros((size, size), np.bool_), np.empty(len(points), np.int32)
    count, _ = draw(squares, taken, marks, points, robot, (*corner, cell, size), comfort)
    centres = corner[:, None, None] + (np.indices((size, size)) + 0.5) * cell
    away = np.hypot(*(centres[..., None] - points.T[:, None, None])).min(axis=-1, initial=np.inf)
    found = np.sqrt(squares[border:-border, border:-border]) * cell
    np.testing.assert_allclose(np.minimum(found, comfort), np.minimum(away, comfort), rtol=0, atol=KERNEL)
    erase(squares, taken, marks, count, comfort, cell)
    assert np.isinf(squares).all()
    assert not taken.any()


def test_the_first_of_two_points_in_a_cell_counts():
    border = pad(0.5, 0.1)
    squares = np.full((10 + 2 * border, 10 + 2 * border), np.inf)
    taken, marks, robot = np.zeros((10, 10), np.bool_), np.empty(2, np.int32), np.array([0.5, 0.35])
    points = np.array([[0.51, 0.51], [0.55, 0.55]])
    count, nearest = draw(squares, taken, marks, points, robot, (0.0, 0.0, 0.1, 10), 0.5)
    assert count == 1
    assert np.isclose(squares[border + 5, border + 5], 2 * 0.4**2)
    assert np.isclose(nearest, np.hypot(0.01, 0.16))
