"""Levenberg–Marquardt: it finds the minimum that scipy finds, never climbs, and survives what has no solution."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from lme.planners.teb.band import optimize
from lme.planners.teb.kernels import normal_equations
from lme.types import Twist
from tests import oracles

BOX = (0.21, 0.155, 0.0)
BOUNDS = (0.0, 0.8, 1.57, 8.0, 20.0, 0.13, 0.1)
WEIGHTS = (10.0, 3.0, 1.0, 2.0, 2.0, 100.0, 700.0, 15.0, 3.0, 50.0)
NEAR = np.array([[2, 0.5, 0.25], [3, 0.9, 0.3]], dtype=float)
OTHERS = (Twist(0.5, 0.0), NEAR, np.empty((0, 3)), 0.0, BOX, BOUNDS, WEIGHTS)


def band():
    poses = np.column_stack([np.linspace(0.0, 1.5, 7), np.zeros(7), np.zeros(7)])
    return poses, np.full(6, 0.3)


def equations(poses, times):
    return normal_equations(poses, times, *OTHERS)


def test_it_finds_the_minimum_that_scipy_finds():
    poses, times = band()

    def errors(free):
        p, t = poses.copy(), free[:6]
        p[1:-1] = free[6:].reshape(-1, 3)
        return oracles.teb_errors(p, t, *OTHERS)

    found = optimize(poses, times, equations, 200)
    expected = least_squares(errors, np.append(times, poses[1:-1].ravel()))
    assert found[2] == pytest.approx(2.0 * expected.cost, rel=1e-3)
    assert found[0][2, 1] < -0.05  # round the obstacles


def test_more_iterations_never_cost_more():
    totals = [optimize(*band(), equations, count)[2] for count in range(1, 12)]
    assert (np.diff(totals) <= 0.0).all()
    assert totals[-1] < equations(*band())[0]


def test_the_ends_stay_and_time_runs_on():
    poses, times, _ = optimize(*band(), equations, 20)
    np.testing.assert_array_equal(poses[[0, -1]], band()[0][[0, -1]])
    assert (times > 0.0).all()


def test_a_step_to_time_that_runs_back_is_refused():
    def backwards(poses, times):
        total = float(times.sum())
        matrix, descent = np.zeros((11, 28)), np.zeros(28)
        matrix[0], descent[3:-4:4] = 1.0, -5.0
        return total, matrix, descent

    _, times, total = optimize(*band(), backwards, 5)
    assert (times > 0.0).all()
    assert total < 1.8


def test_a_band_without_finite_errors_is_lost():
    poses, times = band()
    poses[2] = np.nan
    found = optimize(poses, times, equations, 5)
    assert found[2] == np.inf
    assert found[0] is poses


def test_a_matrix_that_is_not_positive_definite_moves_nothing():
    def hopeless(poses, times):
        return 1.0, np.full((11, 28), -1.0), np.ones(28)

    poses, _, total = optimize(*band(), hopeless, 5)
    np.testing.assert_array_equal(poses, band()[0])
    assert total == 1.0
