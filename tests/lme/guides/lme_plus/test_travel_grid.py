"""Distances to the nearest points: every cell against every point, and nothing left behind."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lme.guides.lme_plus.travel_grid import draw, erase, pad
from tests.tolerances import KERNEL


def nothing_in(size):
    """The list of points of each cell."""
    return np.full((size, size), -1, np.int32)


@given(
    st.integers(0, 10**6),
    st.sampled_from([0.2, 0.5, 0.52, 1.7]),
    st.sampled_from([0.3, 0.9, 1.0]),
    st.sampled_from([0.1, 0.15]),
)
def test_distances_agree_with_those_to_all_points_and_are_erased(seed, comfort, share, cell):
    rng = np.random.default_rng(seed)
    size, corner, robot, inner = 20, rng.uniform(-5.0, 5.0, 2), rng.uniform(-2.0, 2.0, 2), share * comfort
    points = corner + rng.uniform(-0.5, size * cell + 0.5, (rng.integers(0, 12), 2))
    beside = points + rng.normal(0.0, 0.1 * cell, points.shape)  # most in the same cells
    points = np.concatenate((points, beside))
    of_cell = np.floor((points - corner) / cell)
    within = ((of_cell >= 0) & (of_cell < size)).all(axis=1)
    counts = ~within
    counts[np.unique(np.where(within[:, None], of_cell, np.inf), axis=0, return_index=True)[1]] = True
    border = pad(comfort, cell)
    squares = np.full((size + 2 * border, size + 2 * border), np.inf)
    lists = nothing_in(size), np.empty(len(points), np.int32), np.empty(len(points), np.int32)
    count, _ = draw(squares, *lists, points, robot, (*corner, cell, size), comfort, inner)
    found = np.sqrt(squares[border:-border, border:-border]) * cell
    of_all, of_first = (distances(each, corner, size, cell) for each in (points, points[counts]))
    near = of_all < inner
    np.testing.assert_allclose(found[near], of_all[near], rtol=0, atol=KERNEL)
    assert (np.minimum(found, comfort) <= np.minimum(of_first, comfort) + KERNEL).all()
    assert (found >= of_all - KERNEL).all()
    first, _, marks = lists
    erase(squares, first, marks, count, comfort, cell)
    assert np.isinf(squares).all()
    np.testing.assert_array_equal(first, nothing_in(size))


def distances(points, corner, size, cell):
    """Of each cell's centre to the nearest of the points (M, 2): (size, size) [m]."""
    centres = corner[:, None, None] + (np.indices((size, size)) + 0.5) * cell
    return np.hypot(*(centres[..., None] - points.T[:, None, None])).min(axis=-1, initial=np.inf)


def test_far_away_the_first_of_two_points_in_a_cell_counts_and_both_are_listed():
    border = pad(0.5, 0.1)
    squares = np.full((10 + 2 * border, 10 + 2 * border), np.inf)
    first, following, marks, robot = nothing_in(10), *np.empty((2, 2), np.int32), np.array([0.5, 0.35])
    points = np.array([[0.51, 0.51], [0.55, 0.55]])
    count, nearest = draw(squares, first, following, marks, points, robot, (0.0, 0.0, 0.1, 10), 0.5, 0.2)
    assert count == 1
    assert first[5, 5] == 1
    assert following.tolist() == [-1, 0]
    assert (np.delete(first.ravel(), 55) == -1).all()
    assert np.isclose(squares[border + 5, border + 5], 0.0)
    assert np.isclose(squares[border + 5, border + 8], 0.4**2 + 3.4**2)
    assert np.isclose(nearest, np.hypot(0.01, 0.16))
