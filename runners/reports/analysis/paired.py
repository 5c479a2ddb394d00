"""Paired comparison of a variant with a baseline, by world and run, with the world as the unit.

Runs in one world are not independent, so the bootstrap resamples worlds and the permutation test flips the signs of
worlds. The value of a world is the mean of its paired differences. Seeds are fixed: the same records give the same
figures.

The bootstrap and the permutation test are implemented here because `scipy.stats` draws other signs, does not treat
sums that differ by rounding as ties, takes ten times as long, and needs a second to import. It does not have Holm's
method. The tests compare with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np

from lme.types import Floats, Ints
from runners.config.changes import is_config_key
from runners.reports.analysis.summary import (
    BARN_METRIC,
    Row,
    as_text,
    barn_metric,
    measure,
    numbers,
    row_keys,
)

if TYPE_CHECKING:
    import pandas as pd

SUCCESS, COLLISION, METRIC = "success", "collision", BARN_METRIC
LEVEL = 0.05  # significance level; intervals have the confidence 1 − LEVEL
POWER = 0.8  # share of comparisons in which an effect is to be found
LEAST_P = 0.001  # smaller ones are shown as less than this
RESAMPLES = 9999
SEED = 0
TIE = 1e-9  # sums that differ by less are equal
_KEPT = 1000  # worlds up to which draws and signs are drawn once, 80 MB each, and beyond which they come in blocks
TEST = (  # for a caption
    "Differences are paired by world and run, with 95 % bootstrap intervals and sign-flip permutation tests over "
    f"worlds, adjusted by Holm; bold ones have an adjusted p below {LEVEL:g}."
)
IN_TITLE = ("map", "subset", "robot")  # shown by `runners.reports.analysis.tables.title`
NOTES = (
    "Differences are paired by world and run and averaged over worlds; the world is the unit, as runs of one "
    "world are not independent.",
    "Intervals: 95 %, bootstrap over worlds. p: sign-flip permutation over worlds, adjusted by Holm over all "
    "differences in one measure.",
    f"Beyond the noise: the adjusted p is below {LEVEL:g}.",
)


@dataclass(frozen=True, slots=True)
class Difference:
    """Mean paired difference from the baseline. low, high: interval. p: p-value. NaN with fewer than two worlds.

    pairs: number of paired episodes. spread: standard deviation over worlds; NaN with fewer than two. adjusted: p
    adjusted by Holm's method over all differences compared together.
    """

    mean: float
    low: float
    high: float
    p: float
    worlds: int
    pairs: int
    spread: float = math.nan
    adjusted: float = math.nan

    @property
    def beyond_noise(self) -> bool:
        """Return whether the difference is significant."""
        return self.adjusted < LEVEL

    def worlds_for(self, effect: float) -> int | None:
        """Return how many worlds with this spread show an effect of this size in `POWER` of all comparisons.

        None if the spread is not known or 0. From the normal approximation of a paired test, without Holm's correction.
        """
        if not self.spread > 0.0:
            return None
        normal = NormalDist()
        quantiles = normal.inv_cdf(1.0 - LEVEL / 2.0) + normal.inv_cdf(POWER)
        return math.ceil((quantiles * self.spread / effect) ** 2)


@dataclass(frozen=True, slots=True)
class Block:
    """Records that differ in only one column. keys: values that distinguish this block from others, by column."""

    keys: dict[str, str]
    baseline: pd.DataFrame
    variants: dict[str, pd.DataFrame]

    @property
    def heading(self) -> str:
        """The system and the other keys, without those that the title shows: map, subset, robot, changed keys."""
        common = {
            key: value
            for key, value in self.keys.items()
            if value and key not in IN_TITLE and not is_config_key(key)
        }
        return ", ".join(value if key == "system" else f"{key} {value}" for key, value in common.items())


def blocks(
    frame: pd.DataFrame, column: str, baseline: str, keys: Sequence[str] | None = None
) -> Iterator[Block]:
    """Split records by `keys`, and each part by `column`; skip a part without the baseline or without a variant.

    keys: by default the system and all other columns that vary.
    """
    if column not in frame:
        return
    if keys is None:
        keys = ["system", *(key for key in row_keys(frame) if key != column)]
    texts = frame.assign(**{key: as_text(frame[key]) for key in [*keys, column]})
    for values, group in texts.groupby(list(keys), sort=False) if keys else [((), texts)]:
        by_value = {str(value): variant_frame for value, variant_frame in group.groupby(column, sort=False)}
        baseline_frame = by_value.pop(baseline, None)
        if baseline_frame is not None and by_value:
            yield Block(dict(zip(keys, map(str, values), strict=True)), baseline_frame, by_value)


def compare(block: Block, quantity: str) -> dict[str, Difference]:
    """Return the difference of each variant from the baseline, by name; variants without pairs are left out."""
    variants = {name: values(frame, quantity) for name, frame in block.variants.items()}
    return compare_values(values(block.baseline, quantity), variants)


def compare_values(baseline: pd.Series, variants: Mapping[str, pd.Series]) -> dict[str, Difference]:
    """Return the same as `compare`, from the values of a quantity, as `values` returns them."""
    pairs = {name: _difference(baseline, variant) for name, variant in variants.items()}
    differences = {name: value for name, value in pairs.items() if value is not None}
    adjusted = holm([value.p for value in differences.values()])
    return {
        name: replace(value, adjusted=p)
        for (name, value), p in zip(differences.items(), adjusted, strict=True)
    }


def difference(baseline: pd.DataFrame, variant: pd.DataFrame, quantity: str) -> Difference | None:
    """Return `variant` minus `baseline` in a quantity, over the episodes that both have; None if there are none."""
    return _difference(values(baseline, quantity), values(variant, quantity))


def _difference(baseline: pd.Series, variant: pd.Series) -> Difference | None:
    changes = (variant - baseline).dropna()
    if changes.empty:
        return None
    # The worlds are the units: the value of each is the mean of its paired differences.
    by_world = changes.groupby("world").mean().to_numpy()
    low, high, p = _interval_and_p(by_world)
    spread = float(by_world.std(ddof=1)) if len(by_world) > 1 else math.nan
    return Difference(float(by_world.mean()), low, high, p, len(by_world), len(changes), spread)


def interval_of_mean(frame: pd.DataFrame, quantity: str) -> tuple[float, float]:
    """Return the 95 % interval of a quantity's mean, bootstrapped over worlds; (NaN, NaN) for fewer than two."""
    by_world = values(frame, quantity).dropna().groupby("world").mean().to_numpy()
    return _bounds(by_world) if len(by_world) > 1 else (math.nan, math.nan)


def values(frame: pd.DataFrame, quantity: str) -> pd.Series:
    """Return the quantity of each episode, indexed by world and run; NaN where it is unknown."""
    if quantity == METRIC and METRIC in frame:
        frame = frame.assign(**{METRIC: barn_metric(frame)})
    indexed = frame.set_index(["world", "run"])
    if quantity in (SUCCESS, COLLISION):
        return (indexed["outcome"] == quantity).astype(float)
    return indexed.reindex(columns=[quantity])[quantity].astype(float)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return the p-values adjusted by Holm's method (1979, https://www.jstor.org/stable/4615733); NaN stays NaN."""
    order = sorted((p, index) for index, p in enumerate(p_values) if not math.isnan(p))
    adjusted = [math.nan] * len(p_values)
    smallest = 0.0
    # The k-th smallest of m p-values, from k = 0, times (m − k), at most 1 and never less than the one before.
    for rank, (p, index) in enumerate(order):
        smallest = max(smallest, min(1.0, (len(order) - rank) * p))
        adjusted[index] = smallest
    return adjusted


def signed(value: float) -> str:
    """Return three decimals and a sign, with a minus as wide as a plus; no sign if the value rounds to zero."""
    text = f"{value:+.3f}".replace("-", "\u2212")
    return "0.000" if float(f"{value:.3f}") == 0 else text


def interval(value: Difference) -> str:
    """Return an interval such as "−0.500 to −0.333"; empty if there is none."""
    return "" if math.isnan(value.low) else f"{signed(value.low)} to {signed(value.high)}"


def p_value(value: Difference) -> str:
    """Return the adjusted p with three decimals; empty if there is none."""
    if math.isnan(value.adjusted):
        return ""
    return f"< {LEAST_P:g}" if value.adjusted < LEAST_P else f"{value.adjusted:.3f}"


def row(frame: pd.DataFrame) -> Row:
    """Return the figures of the baseline or of a variant, as a row of a table."""
    return measure(frame, str(frame["system"].iloc[0]), {})


def to_mapping(figures: Row, differences: Mapping[str, Difference]) -> dict[str, float | bool | None]:
    """Return the columns of a CSV for a row and its differences by measure, not rounded."""
    columns: dict[str, float | bool | None] = {
        "episodes": figures.episodes,
        "worlds": figures.worlds,
        "runs": figures.runs,
        **numbers(figures),
    }
    for name, value in differences.items():
        columns |= {
            f"{name}_difference": value.mean,
            f"{name}_difference_low": value.low,
            f"{name}_difference_high": value.high,
            f"{name}_difference_p": value.p,
            f"{name}_difference_p_holm": value.adjusted,
            f"{name}_beyond_noise": value.beyond_noise,
        }
    return columns


def _interval_and_p(by_world: Floats) -> tuple[float, float, float]:
    """Return the interval of the mean of differences (W,), and the p-value of mean zero; NaN if W is less than 2."""
    worlds = len(by_world)
    if worlds < 2:
        return math.nan, math.nan, math.nan
    low, high = _bounds(by_world)
    # TIE: sums that are equal in exact arithmetic must not differ by rounding.
    least = abs(by_world.sum()) - TIE
    num_as_far = sum(np.count_nonzero(np.abs(signs @ by_world) >= least) for signs in _signs(worlds))
    # With all sign flips the p-value is exact; with random ones, the observed signs count as one more draw.
    p = num_as_far / 2**worlds if _all_signs_fit(worlds) else (1 + num_as_far) / (1 + RESAMPLES)
    return low, high, float(p)


def _bounds(by_world: Floats) -> tuple[float, float]:
    """Return the bootstrap interval of the mean of one value per world (W,)."""
    means = np.concatenate([by_world[draws].mean(axis=1) for draws in _draws(len(by_world))])
    low, high = np.quantile(means, [LEVEL / 2, 1 - LEVEL / 2])
    return float(low), float(high)


def _draws(worlds: int) -> Iterable[Ints]:
    """Return blocks of indices (…, W) of worlds drawn with replacement, RESAMPLES rows in all, for the bootstrap."""
    if worlds <= _KEPT:
        return (_kept_draws(worlds),)
    rng = np.random.default_rng(SEED)
    return (rng.integers(worlds, size=(rows, worlds)) for rows in _rows_of_blocks(worlds))


def _signs(worlds: int) -> Iterable[Floats]:
    """Return blocks of signs (…, W), +1 or -1: all combinations if they are few, else RESAMPLES random rows in all."""
    if worlds <= _KEPT:
        return (_kept_signs(worlds),)
    rng = np.random.default_rng(SEED)
    return (rng.choice([-1.0, 1.0], size=(rows, worlds)) for rows in _rows_of_blocks(worlds))


def _rows_of_blocks(worlds: int) -> Iterator[int]:
    """Yield the numbers of rows of blocks that fit into memory however many worlds there are."""
    rows = max(1, RESAMPLES * _KEPT // worlds)
    for first in range(0, RESAMPLES, rows):
        yield min(rows, RESAMPLES - first)


@cache
def _kept_draws(worlds: int) -> Ints:
    return np.random.default_rng(SEED).integers(worlds, size=(RESAMPLES, worlds))


@cache
def _kept_signs(worlds: int) -> Floats:
    if _all_signs_fit(worlds):
        # Row i holds the bits of i.
        bits = np.arange(2**worlds)[:, None] >> np.arange(worlds) & 1
        return np.where(bits, -1.0, 1.0).astype(np.float64)
    return np.random.default_rng(SEED).choice([-1.0, 1.0], size=(RESAMPLES, worlds))


def _all_signs_fit(worlds: int) -> bool:
    """Return whether there are so few combinations of signs that all of them are tried."""
    return worlds < RESAMPLES.bit_length()
