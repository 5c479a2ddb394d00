"""The normal equations of a band: errors and derivatives against the slow twin and its finite differences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.planners.teb.kernels import BANDS, normal_equations
from lme.types import Twist
from tests import oracles

SEEDS = st.integers(0, 2**32 - 1)
BOX = (0.21, 0.155, 0.0)
BOUNDS = (0.1, 0.5, 1.0, 0.8, 1.5, 0.3, 0.05)
WEIGHTS = (10.0, 3.0, 1.0, 2.0, 2.0, 100.0, 70.0, 15.0, 3.0, 50.0)
STEP = 1e-7
TOLERANCE = 1e-4  # of second-order sums of differences by STEP, relative to the greatest element


def drawn(seed):
    """Arguments of the normal equations: a rough band in which every error occurs."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 9))
    poses = rng.uniform((0.0, -0.3, -1.0), (0.2, 0.3, 1.0), (count, 3))
    poses[:, 0] += 0.15 * np.arange(count)
    times = rng.uniform(0.1, 0.6, count - 1)
    index = rng.integers(1, count - 1, (2, 6))
    near, via = (np.column_stack([each, poses[each, :2] + rng.uniform(-0.5, 0.5, (6, 2))]) for each in index)
    return poses, times, Twist(0.3, -0.2), near, via, float(rng.integers(-1, 2)), BOX, BOUNDS, WEIGHTS


def differences(poses, times, *others):
    """The derivatives (E, 4 N) of the slow twin's errors."""
    columns = []
    for k in range(4 * len(poses)):
        sides = []
        for sign in (1.0, -1.0):
            p, t = poses.copy(), np.append(times, 0.0)
            (t if k % 4 == 3 else p[:, k % 4])[k // 4] += sign * STEP
            sides.append(oracles.teb_errors(p, t[:-1], *others))
        columns.append((sides[0] - sides[1]) / (2.0 * STEP))
    return np.array(columns).T


@given(SEEDS)
def test_the_equations_are_those_of_the_slow_twin(seed):
    band = drawn(seed)
    total, matrix, descent = normal_equations(*band)
    errors, jacobian = oracles.teb_errors(*band), differences(*band)
    assert total == pytest.approx(errors @ errors, rel=1e-9)
    free = np.arange(3, 4 * len(band[0]) - 4)
    scale = np.abs(jacobian[:, free]).max() ** 2
    expected = -jacobian.T @ errors
    assert descent[free] == pytest.approx(
        expected[free], abs=TOLERANCE * np.sqrt(scale) * np.abs(errors).max()
    )
    squares = jacobian.T @ jacobian
    for d in range(BANDS):
        column = free[: max(len(free) - d, 0)]
        assert matrix[d, column] == pytest.approx(squares[column + d, column], abs=TOLERANCE * scale)
    far = np.abs(np.subtract.outer(free, free)) >= BANDS
    assert np.abs(squares[np.ix_(free, free)][far]).max(initial=0.0) == 0.0


def test_the_ends_are_fixed():
    _, matrix, descent = normal_equations(*drawn(1))
    for k in (0, 1, 2, -4, -3, -2, -1):
        assert descent[k] == 0.0
        assert matrix[0, k] == 1.0
    assert (matrix[1:, :3] == 0.0).all()


@pytest.mark.parametrize("term", range(len(WEIGHTS)))
def test_every_weight_has_its_error(term):
    poses, times, twist, near, via, _, box, bounds, _ = drawn(3)
    alone = tuple(np.eye(len(WEIGHTS))[term])
    assert normal_equations(poses, times, twist, near, via, 1.0, box, bounds, alone)[0] > 0.0
