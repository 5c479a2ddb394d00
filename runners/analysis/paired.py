"""Whether a change made a difference: paired by world and run, with the world as the unit.

Runs of one world are not independent, so what is resampled and what changes its sign are worlds, each with the
mean of its paired differences. Seeds are fixed: the same records give the same figures.

Bootstrap and permutation test are written out here: `scipy.stats` draws other signs, treats sums that differ by a
rounding as different, takes ten times as long, and a second to import. It has no Holm. The tests compare with it.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.types import Floats, Ints
from runners.analysis.summary import Row, as_text, measure, numbers, row_keys
from runners.records.whole_file import replacing

if TYPE_CHECKING:
    import pandas as pd

SUCCESS, METRIC = "success", "barn_metric"
LEVEL = 0.05  # of the tests; intervals hold 1 − LEVEL
RESAMPLES = 9999
SEED = 0
TIE = 1e-9
IN_TITLE = ("map", "subset", "robot")  # of `runners.analysis.summary.title`
NOTES = (
    "Differences are paired by world and run and averaged over worlds; the world is the unit, as runs of one "
    "world are not independent.",
    "Intervals: 95 %, bootstrap over worlds. p: sign-flip permutation over worlds, adjusted by Holm over all "
    "differences in one measure.",
    f"Beyond the noise: the adjusted p is below {LEVEL:g}.",
)


@dataclass(frozen=True, slots=True)
class Difference:
    """Mean paired difference to the baseline. low, high, p: NaN where there are fewer than two worlds.

    adjusted: p by Holm over all differences that were made together. pairs: episodes on either side.
    """

    mean: float
    low: float
    high: float
    p: float
    worlds: int
    pairs: int
    adjusted: float = math.nan

    @property
    def beyond_noise(self) -> bool:
        """Whether it is there at all, at the level of the test."""
        return self.adjusted < LEVEL


@dataclass(frozen=True, slots=True)
class Block:
    """Records that differ in one column alone. keys: what tells this block from the others, by column."""

    keys: dict[str, str]
    baseline: pd.DataFrame
    variants: dict[str, pd.DataFrame]

    @property
    def heading(self) -> str:
        """The system, and what else tells the block apart, beside map, subset and robot, which its title has."""
        told = {key: value for key, value in self.keys.items() if value and key not in IN_TITLE}
        return ", ".join(value if key == "system" else f"{key} {value}" for key, value in told.items())


def blocks(frame: pd.DataFrame, column: str, baseline: str) -> Iterator[Block]:
    """Split records by whatever else varies; blocks without the baseline or without a variant are left out."""
    if column not in frame:
        return
    keys = ["system", *(key for key in row_keys(frame) if key != column)]
    texts = frame.assign(**{key: as_text(frame[key]) for key in [*keys, column]})
    for values, group in texts.groupby(keys, sort=False):
        by_value = {str(value): part for value, part in group.groupby(column, sort=False)}
        without = by_value.pop(baseline, None)
        if without is not None and by_value:
            yield Block(dict(zip(keys, map(str, values), strict=True)), without, by_value)


def compare(block: Block, quantity: str) -> dict[str, Difference]:
    """Every variant of a block that has pairs against its baseline, by the variant's name."""
    pairs = {name: difference(block.baseline, part, quantity) for name, part in block.variants.items()}
    found = {name: value for name, value in pairs.items() if value is not None}
    adjusted = holm([value.p for value in found.values()])
    return {
        name: replace(value, adjusted=p) for (name, value), p in zip(found.items(), adjusted, strict=True)
    }


def difference(baseline: pd.DataFrame, variant: pd.DataFrame, quantity: str) -> Difference | None:
    """`variant` minus `baseline` in a quantity, over the episodes that both have; None where there are none."""
    one, other = (_values(part, quantity) for part in (baseline, variant))
    changes = (other - one).dropna()
    if changes.empty:
        return None
    by_world = changes.groupby("world").mean().to_numpy()
    low, high, p = _tested(by_world)
    return Difference(float(by_world.mean()), low, high, p, len(by_world), len(changes))


def holm(p_values: Sequence[float]) -> list[float]:
    """p-values adjusted for being several (Holm 1979, https://www.jstor.org/stable/4615733); NaN stay NaN."""
    order = sorted((p, index) for index, p in enumerate(p_values) if not math.isnan(p))
    adjusted = [math.nan] * len(p_values)
    least = 0.0
    for rank, (p, index) in enumerate(order):
        least = max(least, min(1.0, (len(order) - rank) * p))
        adjusted[index] = least
    return adjusted


def signed(value: float) -> str:
    """Three digits, with a sign that is as wide as a plus; no sign for what rounds to zero."""
    text = f"{value:+.3f}".replace("-", "\u2212")
    return "0.000" if float(f"{value:.3f}") == 0 else text


def interval(value: Difference) -> str:
    """ "−0.500 to −0.333"; empty where there is none."""
    return "" if math.isnan(value.low) else f"{signed(value.low)} to {signed(value.high)}"


def row(part: pd.DataFrame) -> Row:
    """The figures of the baseline or of a variant."""
    return measure(part, str(part["system"].iloc[0]), {})


def to_mapping(figures: Row, found: Mapping[str, Difference]) -> dict[str, float | bool | None]:
    """A row and its differences by measure as columns of a CSV, unrounded."""
    columns: dict[str, float | bool | None] = {
        "episodes": figures.episodes,
        "worlds": figures.worlds,
        "runs": figures.runs,
        **numbers(figures),
    }
    for name, value in found.items():
        columns |= {
            f"{name}_difference": value.mean,
            f"{name}_difference_low": value.low,
            f"{name}_difference_high": value.high,
            f"{name}_difference_p": value.p,
            f"{name}_difference_p_holm": value.adjusted,
            f"{name}_beyond_noise": value.beyond_noise,
        }
    return columns


def write_csv(lines: Sequence[Mapping[str, object]], path: Path) -> None:
    """All columns that any line has, in the order in which they come up."""
    names = list(dict.fromkeys(name for line in lines for name in line))
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(lines)


def _values(part: pd.DataFrame, quantity: str) -> pd.Series:
    """The quantity of every episode, by world and run."""
    indexed = part.set_index(["world", "run"])
    if quantity == SUCCESS:
        return (indexed["outcome"] == SUCCESS).astype(float)
    return indexed.reindex(columns=[quantity])[quantity].astype(float)


def _tested(by_world: Floats) -> tuple[float, float, float]:
    """Interval of the mean of the (W,) differences, and p of its being zero; NaN for fewer than two."""
    worlds = len(by_world)
    if worlds < 2:
        return math.nan, math.nan, math.nan
    low, high = np.quantile(by_world[_draws(worlds)].mean(axis=1), [LEVEL / 2, 1 - LEVEL / 2])
    signs = _signs(worlds)
    # Sums that are equal on paper must not differ by a rounding.
    as_far = np.abs(signs @ by_world) >= abs(by_world.sum()) - TIE
    every = len(signs) == 2**worlds
    p = as_far.mean() if every else (1 + as_far.sum()) / (1 + len(signs))
    return float(low), float(high), float(p)


@cache
def _draws(worlds: int) -> Ints:
    """(RESAMPLES, W) worlds drawn with replacement: the bootstrap."""
    return np.random.default_rng(SEED).integers(worlds, size=(RESAMPLES, worlds))


@cache
def _signs(worlds: int) -> Floats:
    """(S, W) of +1 and -1: every combination where there are few, else RESAMPLES at random."""
    if 2**worlds <= RESAMPLES:
        bits = np.arange(2**worlds)[:, None] >> np.arange(worlds) & 1
        return np.where(bits, -1.0, 1.0).astype(np.float64)
    return np.random.default_rng(SEED).choice([-1.0, 1.0], size=(RESAMPLES, worlds))
