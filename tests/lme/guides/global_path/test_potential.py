"""Navfn's wave and the path down its gradient."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lme.guides.global_path.potential import descend, potential
from tests import oracles

SEEDS = st.integers(0, 2**32 - 1)
NEUTRAL = 50.0
ORDER = (
    0.02  # [-] relative: where the plane wave passes into a straight one, the order of updates decides 0.5 %
)


def field(seed):
    """Paid costs (24, 30), and two cells inside."""
    rng = np.random.default_rng(seed)
    paid = NEUTRAL + rng.integers(0, 200, (24, 30)) * (rng.random((24, 30)) < 0.3)
    paid[rng.random((24, 30)) < 0.25] = np.inf
    paid[[0, -1]], paid[:, [0, -1]] = np.inf, np.inf
    start, goal = ((int(rng.integers(1, 23)), int(rng.integers(1, 29))) for _ in range(2))
    return paid, start, goal


@given(SEEDS)
def test_potentials_are_the_slow_twin(seed):
    paid, start, goal = field(seed)
    wave, expected = potential(paid, start, goal, NEUTRAL), oracles.navfn_potential(paid, start)
    if goal != start and np.isinf(paid[goal]):
        assert np.isinf(wave[goal])
        return
    reached = expected <= expected[goal]
    np.testing.assert_allclose(wave[reached], expected[reached], rtol=ORDER)


@given(SEEDS)
def test_a_path_leads_from_the_start_to_the_goal_without_jumps(seed):
    paid, start, goal = field(seed)
    wave = potential(paid, start, goal, NEUTRAL)
    path = descend(wave, start, goal, NEUTRAL)
    if np.isinf(wave[goal]):
        assert len(path) == 0
    if len(path) > 0:
        assert tuple(path[0]) == start
        assert np.abs(path[-1] - goal).max() <= 1.0
        assert np.hypot(*np.diff(path, axis=0).T).max(initial=0.0) <= 3.0  # the last step is to the start


def test_a_path_through_free_space_is_straight_in_steps_of_half_a_cell():
    paid = np.full((40, 40), NEUTRAL)
    paid[[0, -1]], paid[:, [0, -1]] = np.inf, np.inf
    wave = potential(paid, (20, 5), (20, 35), NEUTRAL)
    assert wave[20, 15] == 10.0 * NEUTRAL
    path = descend(wave, (20, 5), (20, 35), NEUTRAL)
    assert np.abs(path[:, 0] - 20.0).max() < 0.01
    np.testing.assert_allclose(np.diff(path[1:, 1]), 0.5, atol=1e-6)


def test_a_forbidden_start_is_left_by_a_passable_neighbour_only():
    paid = np.full((20, 20), NEUTRAL)
    paid[[0, -1]], paid[:, [0, -1]] = np.inf, np.inf
    paid[8:13, 8:13] = np.inf
    assert np.isinf(potential(paid, (10, 10), (10, 15), NEUTRAL)[10, 15])
    assert np.isfinite(potential(paid, (10, 12), (10, 15), NEUTRAL)[10, 15])
