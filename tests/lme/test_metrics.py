"""Metrics against values worked out by hand and against what must hold for any episode."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from lme.errors import InputError
from lme.metrics import (
    barn_metric,
    interval_over_worlds,
    mean_abs_domega,
    mean_std_over_runs,
    reverse_starts,
    reward,
    spl,
    wilson_interval,
)
from lme.types import Outcome
from tests.oracles import slow_interval_over_worlds
from tests.tolerances import KERNEL

lengths = st.floats(0.01, 1e3)


@pytest.mark.parametrize(
    ("time_s", "expected"),
    # OT = 5 s: below 10 s nothing is gained, beyond 40 s nothing is lost, between it is 5 / AT.
    [(1.0, 0.5), (10.0, 0.5), (12.5, 0.4), (20.0, 0.25), (40.0, 0.125), (90.0, 0.125)],
)
def test_barn_metric_by_hand(time_s, expected):
    assert barn_metric(True, time_s, 5.0) == pytest.approx(expected, abs=KERNEL)
    assert barn_metric(False, time_s, 5.0) == 0.0


@given(lengths, lengths)
def test_barn_metric_of_a_success_lies_between_an_eighth_and_a_half(time_s, optimal):
    assert 0.125 - KERNEL <= barn_metric(True, time_s, optimal) <= 0.5 + KERNEL


def test_barn_metric_without_an_optimal_time():
    assert math.isnan(barn_metric(True, 5.0, math.nan))
    with pytest.raises(InputError, match="optimal_time_s is 0"):
        barn_metric(True, 5.0, 0.0)


def test_spl_by_hand():
    assert spl(True, 6.0, 8.0) == 0.75
    assert spl(True, 6.0, 5.0) == 1.0  # within the goal's tolerance a path may be shorter than the shortest
    assert spl(False, 6.0, 6.0) == 0.0
    assert spl(True, 0.0, 0.0) == 1.0


@given(lengths, lengths, st.booleans())
def test_spl_lies_between_zero_and_one(shortest, path, success):
    assert 0.0 <= spl(success, shortest, path) <= 1.0


def test_smoothness_by_hand():
    assert mean_abs_domega([0.0, 0.4, 0.4, -0.2]) == pytest.approx((0.4 + 0.0 + 0.6) / 3, abs=KERNEL)
    assert mean_abs_domega([0.3]) == 0.0  # an episode that starts at the goal


def test_reversals_by_hand():
    assert reverse_starts([0.0, -0.04, -0.06, -0.5, -0.04, -0.2, 0.3, -0.3]) == 3
    assert reverse_starts([-0.5]) == reverse_starts([]) == 0


def test_reward_is_equation_1():
    assert reward(Outcome.SUCCESS, 50, 200, -0.2, -0.3) == 0.75
    assert reward("collision", 50, 200, -0.2, -0.3) == -0.2
    assert reward(Outcome.TIMEOUT, 200, 200, -0.2, -0.3) == -0.3
    with pytest.raises(InputError, match="outcome is 'lost'"):
        reward("lost", 1, 200, -0.2, -0.2)
    with pytest.raises(InputError, match="max_steps is 0"):
        reward("success", 1, 0, -0.2, -0.2)


@pytest.mark.parametrize(
    ("successes", "n", "expected"),
    # Newcombe 1998, table I (method 3): 81/263, 15/148, 0/20, 1/29.
    [
        (81, 263, (0.2553, 0.3662)),
        (15, 148, (0.0624, 0.1605)),
        (0, 20, (0.0, 0.1611)),
        (1, 29, (0.0061, 0.1718)),
    ],
)
def test_wilson_interval_against_published_values(successes, n, expected):
    assert wilson_interval(successes, n) == pytest.approx(expected, abs=5e-5)


@given(st.integers(0, 300), st.integers(0, 300))
def test_wilson_interval_holds_the_rate_and_mirrors(successes, failures):
    n = successes + failures
    low, high = wilson_interval(successes, n)
    assert 0.0 <= low <= (successes / n if n else 0.5) <= high <= 1.0
    mirrored = wilson_interval(failures, n)
    assert (1 - mirrored[1], 1 - mirrored[0]) == pytest.approx((low, high), abs=KERNEL)


@given(st.integers(0, 300), st.integers(1, 300))
def test_wilson_interval_is_scipys(successes, failures):
    n = successes + failures
    expected = stats.binomtest(successes, n).proportion_ci(method="wilson")
    assert wilson_interval(successes, n) == pytest.approx(expected, abs=KERNEL)


def test_wilson_interval_refuses_more_successes_than_trials():
    with pytest.raises(InputError, match="successes is 4 of n = 3"):
        wilson_interval(4, 3)


@given(st.lists(st.tuples(st.integers(0, 4), st.booleans()), min_size=1, max_size=40))
def test_interval_over_worlds_is_its_slow_twin(episodes):
    worlds, successes = zip(*episodes, strict=True)
    low, high = interval_over_worlds(successes, worlds)
    assert (low, high) == pytest.approx(slow_interval_over_worlds(successes, worlds), abs=KERNEL)
    assert 0.0 <= low <= high <= 1.0


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(1, 5))
def test_runs_that_always_agree_count_once(successes, runs):
    worlds = np.arange(len(successes))
    once = wilson_interval(sum(successes), len(successes))
    assert interval_over_worlds(successes, worlds) == pytest.approx(once, abs=KERNEL)
    again = interval_over_worlds(np.repeat(successes, runs), np.repeat(worlds, runs))
    assert again == pytest.approx(once, abs=KERNEL)


def test_interval_over_worlds_holds_the_rate_as_often_as_it_says():
    """Three runs in each of a hundred worlds, most of which always or never succeed: Wilson over episodes is narrow."""
    rng = np.random.default_rng(0)
    worlds, held, held_by_episodes = np.repeat(np.arange(100), 3), 0, 0
    for _ in range(1000):
        success = rng.random(300) < rng.beta(0.9, 0.1, 100)[worlds]
        low, high = interval_over_worlds(success, worlds)
        held += low <= 0.9 <= high
        low, high = wilson_interval(int(success.sum()), 300)
        held_by_episodes += low <= 0.9 <= high
    assert 0.93 <= held / 1000 <= 0.97
    assert held_by_episodes / 1000 < 0.85


def test_interval_over_worlds_agrees_with_a_bootstrap_over_worlds_where_that_works():
    rng = np.random.default_rng(1)
    success = rng.random((400, 3)) < rng.beta(3.0, 3.0, (400, 1))
    rates = success.mean(axis=1)[rng.integers(400, size=(4000, 400))].mean(axis=1)
    found = interval_over_worlds(success.ravel(), np.repeat(np.arange(400), 3))
    assert found == pytest.approx(np.quantile(rates, [0.025, 0.975]), abs=0.004)


def test_interval_over_worlds_of_nothing_and_of_unequal_lengths():
    assert interval_over_worlds([], []) == (0.0, 1.0)
    with pytest.raises(InputError, match="shape"):
        interval_over_worlds([True], [0, 1])


def test_mean_and_std_over_runs_reproduce_the_papers_deviation():
    # Table II, LME: 0.883 ± 0.0094 is 0.87, 0.89, 0.89 over three runs of 100 worlds.
    successes = [[1] * k + [0] * (100 - k) for k in (87, 89, 89)]
    mean, std = mean_std_over_runs(np.ravel(successes), np.repeat([0, 1, 2], 100))
    assert round(mean, 3) == 0.883
    assert round(std, 4) == 0.0094


def test_the_mean_over_runs_weighs_runs_if_they_have_as_many_episodes():
    """Whether or not all episodes count: times are those of successes."""
    values, runs = [1.0, 1.0, 1.0, 0.0, 9.0, 9.0], [0, 0, 0, 1, 1, 1]
    assert mean_std_over_runs(values, runs, [True] * 4 + [False] * 2) == (0.5, 0.5)
    assert mean_std_over_runs(values, runs, [True] * 3 + [False] * 3) == (1.0, 0.0)


def test_runs_may_be_in_any_order():
    """To the last bit those of a mask for every run, which takes too long for ten thousand runs."""
    rng = np.random.default_rng(0)
    values, runs, chosen = rng.normal(size=3000), rng.integers(20, size=3000), rng.random(3000) < 0.7
    means = [values[chosen & (runs == run)].mean() for run in range(20)]
    assert mean_std_over_runs(values, runs, chosen) == (values[chosen].mean(), np.std(means))


def test_the_mean_over_unfinished_runs_weighs_episodes():
    assert mean_std_over_runs([1.0, 1.0, 1.0, 0.0], [0, 0, 0, 1]) == (0.75, 0.5)
    assert mean_std_over_runs([1.0, 1.0, 1.0, 0.0], [0, 0, 0, 1], [True, False, False, True]) == (0.5, 0.5)


@given(st.lists(st.tuples(st.integers(1, 200), st.booleans()), min_size=1, max_size=3))
def test_the_mean_over_runs_lies_in_its_interval(runs):
    """However many worlds each run drove; it succeeds in all or in none."""
    worlds = np.concatenate([np.arange(driven) for driven, _ in runs])
    numbers = np.repeat(np.arange(len(runs)), [driven for driven, _ in runs])
    successes = np.array([succeeds for _, succeeds in runs])[numbers]
    low, high = interval_over_worlds(successes, worlds)
    assert low - KERNEL <= mean_std_over_runs(successes, numbers)[0] <= high + KERNEL


def test_a_mean_over_runs_of_nothing_and_of_unequal_lengths():
    assert all(math.isnan(value) for value in mean_std_over_runs([], []))
    assert all(math.isnan(value) for value in mean_std_over_runs([1.0], [0], [False]))
    with pytest.raises(InputError, match="runs"):
        mean_std_over_runs([1.0], [0, 1])
    with pytest.raises(InputError, match="chosen"):
        mean_std_over_runs([1.0], [0], [True, False])
