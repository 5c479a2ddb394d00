"""Paired differences against figures by hand, and against what must not change them."""

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS
from tests.tolerances import KERNEL


def episodes(successes, runs=1, **columns):
    """One episode for each world and run: `successes` by world, the same in every run."""
    return pd.DataFrame(
        {
            "system": "LME",
            "world": np.repeat(np.arange(len(successes)), runs),
            "run": np.tile(np.arange(runs), len(successes)),
            "outcome": np.repeat(np.where(successes, "success", "timeout"), runs),
            "barn_metric": np.repeat(np.where(successes, 0.4, 0.0), runs),
            **{key: [value] * (len(successes) * runs) for key, value in columns.items()},
        }
    )


def draws(rate, worlds=60, seed=0):
    """Successes at random."""
    return np.random.default_rng(seed).random(worlds) < rate


def test_a_paired_difference_by_hand():
    one, other = episodes([1, 1, 1, 0]), episodes([1, 0, 0, 1])
    found = paired.difference(one, other, SUCCESS)
    assert found.mean == pytest.approx((0 - 1 - 1 + 1) / 4)
    assert (found.worlds, found.pairs) == (4, 4)
    assert paired.difference(one, other, METRIC).mean == pytest.approx(-0.1)


def test_the_interval_of_a_mean_is_that_of_a_difference_from_nothing():
    some = episodes(draws(0.7), runs=2)
    found = paired.difference(episodes([0] * 60, runs=2), some, METRIC)
    low, high = paired.interval_of_mean(some, METRIC)
    assert (low, high) == (found.low, found.high)
    assert low < some["barn_metric"].mean() < high
    assert all(map(math.isnan, paired.interval_of_mean(episodes([1], runs=3), METRIC)))


def test_as_many_worlds_as_are_advised_find_the_difference_as_often():
    """Simulated studies of the advised size find an effect of this size in about 80 % of all cases."""
    rng = np.random.default_rng(0)
    pilot = paired.difference(episodes(rng.random(2000) < 0.80), episodes(rng.random(2000) < 0.90), SUCCESS)
    worlds = pilot.worlds_for(0.1)
    gains = (rng.random((2000, worlds)) < 0.90).astype(float) - (rng.random((2000, worlds)) < 0.80)
    found = stats.ttest_1samp(gains, 0.0, axis=1).pvalue < paired.LEVEL
    assert found.mean() == pytest.approx(paired.POWER, abs=0.05)


def test_equal_or_single_worlds_advise_nothing():
    same = paired.difference(episodes([1, 0, 1]), episodes([1, 0, 1]), SUCCESS)
    single = paired.difference(episodes([1]), episodes([0]), SUCCESS)
    assert (same.worlds_for(0.05), single.worlds_for(0.05)) == (None, None)


def test_few_worlds_have_every_sign_tried():
    """Three worlds that all gain: of eight ways to choose the signs two are as far off."""
    found = paired.difference(episodes([0, 0, 0]), episodes([1, 1, 1]), SUCCESS)
    assert found.p == pytest.approx(2 / 8)


def test_blocks_of_draws_give_the_figures_of_all_at_once(monkeypatch):
    both = episodes(draws(0.9)), episodes(draws(0.7, seed=1))
    whole = paired.difference(*both, SUCCESS)
    monkeypatch.setattr(paired, "_KEPT", 7)
    assert repr(paired.difference(*both, SUCCESS)) == repr(whole)


def test_the_world_is_the_unit():
    """Runs that repeat one another teach nothing: neither the interval nor p gets any better."""
    one, other = draws(0.9), draws(0.7, seed=1)
    single = paired.difference(episodes(one), episodes(other), SUCCESS)
    many = paired.difference(episodes(one, runs=5), episodes(other, runs=5), SUCCESS)
    assert (many.worlds, many.pairs) == (60, 300)
    assert (many.mean, many.low, many.high, many.p) == (single.mean, single.low, single.high, single.p)


@pytest.mark.parametrize("worlds", [2, 5, 60])
def test_the_interval_is_scipys(worlds):
    one, other = draws(0.8, worlds), draws(0.5, worlds, seed=1)
    found = paired.difference(episodes(one), episodes(other), SUCCESS)
    changes = other.astype(float) - one
    expected = stats.bootstrap((changes,), np.mean, method="percentile", rng=paired.SEED)
    assert (found.low, found.high) == pytest.approx(expected.confidence_interval, abs=KERNEL)


@pytest.mark.parametrize("worlds", [5, 60])
def test_p_is_scipys(worlds):
    one, other = draws(0.8, worlds), draws(0.5, worlds, seed=1)
    found = paired.difference(episodes(one), episodes(other), SUCCESS)
    changes = other.astype(float) - one
    expected = stats.permutation_test((changes,), np.mean, permutation_type="samples", rng=0).pvalue
    assert 0 < found.p < 1
    assert found.p == pytest.approx(expected, abs=1e-12 if worlds == 5 else 0.01)


def test_the_order_of_records_does_not_matter():
    one, other = episodes(draws(0.9), runs=2), episodes(draws(0.6, seed=1), runs=2)
    shuffled = [frame.sample(frac=1.0, random_state=3) for frame in (one, other)]
    assert repr(paired.difference(*shuffled, SUCCESS)) == repr(paired.difference(one, other, SUCCESS))


def test_only_episodes_of_both_systems_are_compared():
    one, other = episodes([1, 1, 0, 0], runs=2), episodes([0, 0, 0, 0], runs=2)
    found = paired.difference(one, other.iloc[:3], SUCCESS)
    assert (found.worlds, found.pairs, found.mean) == (2, 3, -1.0)
    assert paired.difference(one, other.iloc[:0], SUCCESS) is None
    assert paired.difference(one.drop(columns="barn_metric"), other, METRIC) is None


def test_one_world_gives_no_interval():
    found = paired.difference(episodes([1], runs=3), episodes([0], runs=3), SUCCESS)
    assert found.mean == -1.0
    assert math.isnan(found.p)
    assert not found.beyond_noise


def test_holm_by_hand():
    """Sorted: 0.01 × 3, 0.02 × 2, 0.04 × 1 but not below the one before."""
    assert paired.holm([0.04, 0.01, 0.02]) == pytest.approx([0.04, 0.03, 0.04])
    assert paired.holm([0.6, 0.9]) == pytest.approx([1.0, 1.0])
    assert paired.holm([0.02, math.nan]) == pytest.approx([0.02, math.nan], nan_ok=True)


def frame(**rates):
    """A sweep over `ablation` with these success rates."""
    parts = [episodes(draws(rate, seed=5), ablation=name, run_dir=name) for name, rate in rates.items()]
    return pd.concat(parts, ignore_index=True)


def test_a_large_change_is_beyond_the_noise_and_none_is_not():
    (block,) = paired.blocks(frame(none=0.9, same=0.9, worse=0.4), "ablation", "none")
    found = paired.compare(block, SUCCESS)
    assert list(found) == ["same", "worse"]
    assert found["worse"].beyond_noise
    assert found["worse"].adjusted == pytest.approx(2 * found["worse"].p)
    assert (found["same"].mean, found["same"].beyond_noise) == (0.0, False)


def test_whatever_else_varies_makes_a_block_of_its_own():
    both = pd.concat(
        [
            frame(none=0.9, no_c_o=0.1).assign(map="barn"),
            frame(none=0.8, no_c_t=0.7).assign(map="traps", run_dir="second"),
            frame(no_c_h=0.8).assign(map="env1", run_dir="third"),
        ]
    )
    found = list(paired.blocks(both, "ablation", "none"))
    assert [(block.keys["map"], list(block.variants)) for block in found] == [
        ("barn", ["no_c_o"]),
        ("traps", ["no_c_t"]),
    ]
    assert found[0].heading == "LME"


def test_a_column_that_is_not_there_has_no_blocks():
    assert list(paired.blocks(episodes([1, 0], run_dir="a"), "scale", "")) == []


@pytest.mark.parametrize(
    ("value", "text"), [(0.0667, "+0.067"), (-0.4167, "\u22120.417"), (-0.0001, "0.000"), (0.0, "0.000")]
)
def test_a_difference_is_written_with_its_sign(value, text):
    assert paired.signed(value) == text
