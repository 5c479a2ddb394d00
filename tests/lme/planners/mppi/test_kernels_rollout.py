"""MPPI's samples: the slow twin, the statistics of the noise, the limits, the mean and the filter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import savgol_filter

from lme.planners.mppi.kernels import average, charge_controls, constrain, rollout, smooth
from lme.planners.mppi.planner import draw
from lme.types import Pose, Twist
from tests import oracles
from tests.tolerances import FLOAT32_LAYER, KERNEL

SEEDS = st.integers(0, 2**32 - 1)
STDS = (0.2, 0.4)
LIMITS = (-0.35, 0.5, 1.9, -3.0, 2.0, 4.0)
DT = 0.05
FREE = (-9.0, 9.0, 9.0, -1e9, 1e9, 1e9)  # limits that bind nothing


def drawn(seed, samples=40, steps=30):
    """A generator, a sequence, noise, a twist and a pose."""
    rng = np.random.default_rng(seed)
    sequence = rng.uniform((-0.3, -1.0), (0.5, 1.0), (steps, 2))
    twist = Twist(rng.uniform(-0.3, 0.5), rng.uniform(-1.0, 1.0))
    pose = Pose(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-3.0, 3.0))
    return rng, sequence, draw(rng, samples, steps), twist, pose


@given(SEEDS)
def test_trajectories_are_the_slow_twin(seed):
    _, sequence, noise, twist, pose = drawn(seed)
    found = rollout(sequence, noise, STDS, twist, pose, LIMITS, DT)
    expected = oracles.mppi_rollout(sequence, noise, STDS, twist, pose, LIMITS, DT)
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, abs=FLOAT32_LAYER)


def test_samples_scatter_about_the_sequence_as_the_noise_says():
    _, sequence, noise, twist, pose = drawn(1, samples=20_000, steps=12)
    controls, *_ = rollout(sequence, noise, STDS, twist, pose, FREE, DT)
    apart = (controls - sequence) / STDS
    error = 5.0 / np.sqrt(len(noise))  # five standard deviations
    assert apart.mean(axis=0) == pytest.approx(np.zeros((12, 2)), abs=error)
    assert apart.std(axis=0) == pytest.approx(np.ones((12, 2)), abs=error)
    across = np.corrcoef(apart.reshape(len(noise), -1).T) - np.eye(24)
    assert np.abs(across).max() < error  # steps and axes are independent of each other


def test_the_same_generator_draws_the_same_noise_and_another_does_not():
    one, same, other = (draw(np.random.default_rng(seed), 9, 8) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()
    assert one.dtype == np.float32


@given(SEEDS, st.floats(0.05, 3.0))
def test_the_mean_is_the_slow_twin(seed, temperature):
    rng, *_ = drawn(seed)
    controls, costs = rng.normal(size=(50, 12, 2)).astype(np.float32), rng.uniform(0.0, 9.0, 50)
    costs[7] = 1e6  # a collision
    found = average(controls, costs, temperature)
    assert found == pytest.approx(oracles.mppi_average(controls, costs, temperature), abs=KERNEL)


def test_departures_cost_what_they_depart():
    rng, sequence, noise, twist, pose = drawn(5)
    controls, *_ = rollout(sequence, noise, STDS, twist, pose, LIMITS, DT)
    costs = rng.uniform(0.0, 1.0, len(controls))
    expected = costs + 0.015 * ((controls - sequence) * sequence / np.square(STDS)).sum(axis=(1, 2))
    charge_controls(costs, sequence, controls, STDS, 0.015)
    assert costs == pytest.approx(expected, abs=KERNEL)


@given(SEEDS)
def test_a_constrained_sequence_keeps_the_limits(seed):
    sequence = np.random.default_rng(seed).uniform(-3.0, 3.0, (40, 2))
    constrain(sequence, LIMITS, DT)
    v, omega = sequence.T
    assert v.min() >= LIMITS[0]
    assert v.max() <= LIMITS[1]
    assert np.abs(omega).max() <= LIMITS[2]
    assert np.abs(np.diff(omega)).max() <= LIMITS[5] * DT + KERNEL
    faster = np.diff(v) * np.where(v[:-1] > 0.0, 1.0, -1.0)
    assert faster.max() <= LIMITS[4] * DT + KERNEL
    assert faster.min() >= LIMITS[3] * DT - KERNEL


def test_the_filter_is_that_of_savitzky_and_golay():
    rng = np.random.default_rng(2)
    sequence, before = rng.normal(size=(56, 2)), rng.normal(size=(4, 2))
    padded = np.vstack([before, sequence, np.repeat(sequence[-1:], 4, axis=0)])
    expected = savgol_filter(padded, 9, 2, axis=0)[4:-4]
    assert smooth(sequence, before)[:-1] == pytest.approx(expected[:-1], abs=KERNEL)
    np.testing.assert_array_equal(smooth(sequence, before)[-1], sequence[-1])
    np.testing.assert_array_equal(smooth(sequence[:20], before), sequence[:20])  # too short
