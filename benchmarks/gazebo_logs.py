"""Comparison of our episodes with logs of the BARN Challenge in Gazebo, world by world.

A log has a line `world success collision timeout time metric` per episode, as written by the challenge's run.py. It
may also be a CSV file whose header names these columns, with `time` or `time_s`, and perhaps `block`.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError
from lme.inputs.guarded_file import read_text
from lme.types import Floats, Outcome

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = ("world", "success", "collision", "timeout", "time", "metric")
_FLAGS = ("success", "collision", "timeout")


@dataclass(frozen=True, slots=True)
class Rates:
    """Shares of the outcomes, and the mean time of successful episodes [s], nan without any."""

    success: float
    collision: float
    timeout: float
    time_s: float
    episodes: int


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of two sets of episodes in the worlds that both have.

    correlation: of the worlds' success rates; nan if either is the same in all worlds. same_verdict: probability that
    one episode of each, in the same world, both reach the goal or both do not. time_ratio: median over worlds of the
    first set's mean time of successful episodes divided by the other's; nan if no world has both. time_correlation:
    of the worlds' mean times of successful episodes; nan if fewer than two worlds have both, or either has no spread.
    """

    one: Rates
    other: Rates
    worlds: int
    correlation: float
    same_verdict: float
    time_ratio: float
    time_correlation: float


def read_log(path: Path, block: str | None = None) -> pd.DataFrame:
    """Read the episodes of a log: columns world, outcome and time_s, as in `episodes.parquet`.

    block: read only the lines of this block. Raises InputError if the file cannot be read or has no such episodes.
    """
    import pandas as pd

    try:
        lines = read_text(path).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: cannot be read as a log of BARN episodes ({error}): must be a text file"
        ) from None
    # Lines with commas are CSV with a header, all others have the columns of run.py.
    split = list(csv.reader(lines)) if lines and "," in lines[0] else [line.split() for line in lines]
    header = [name.strip() for name in split[0]] if split and "world" in split[0] else list(_COLUMNS)
    rows = [
        _episode(path, number, dict(zip(header, words, strict=False)))
        for number, words in enumerate(split, 1)
        if words
        and words != header
        and (block is None or _cell(path, number, header, words, "block") == block)
    ]
    if not rows:
        raise InputError(
            f"{path}: has no episodes{'' if block is None else f' of block {block}'}: must have at least one"
        )
    return pd.DataFrame(rows, columns=["world", "outcome", "time_s"])


def agreement(frame: pd.DataFrame, reference: pd.DataFrame) -> Agreement:
    """Compare two sets of episodes in the worlds that both have. Raises InputError if there are none."""
    shared = sorted(set(frame["world"]) & set(reference["world"]))
    if not shared:
        raise InputError("worlds: the episodes and the log have no world in common: must have at least one")
    frame, reference = frame[frame["world"].isin(shared)], reference[reference["world"].isin(shared)]
    # Success rates p and q by world, and mean times of success by world.
    p, q = _success_by_world(frame), _success_by_world(reference)
    times, reference_times = _mean_times(frame, reference)
    return Agreement(
        one=rates(frame),
        other=rates(reference),
        worlds=len(shared),
        correlation=_correlation(p, q),
        same_verdict=float((p * q + (1.0 - p) * (1.0 - q)).mean()),
        time_ratio=float(np.median(times / reference_times)) if len(times) else math.nan,
        time_correlation=_correlation(times, reference_times) if len(times) > 1 else math.nan,
    )


def rates(frame: pd.DataFrame) -> Rates:
    """Return shares of the outcomes and mean time of success of episodes with the columns outcome and time_s."""
    share = {outcome: float((frame["outcome"] == outcome).mean()) for outcome in _FLAGS}
    times = frame.loc[frame["outcome"] == Outcome.SUCCESS, "time_s"]
    return Rates(**share, time_s=float(times.mean()), episodes=len(frame))


def _success_by_world(frame: pd.DataFrame) -> Floats:
    """Return the success rate of each world, in the order of their numbers."""
    by_world = (frame["outcome"] == Outcome.SUCCESS).groupby(frame["world"]).mean()
    return np.asarray(by_world, dtype=np.float64)


def _correlation(p: Floats, q: Floats) -> float:
    """Return Pearson's correlation; nan if either has no spread."""
    return float(np.corrcoef(p, q)[0, 1]) if np.ptp(p) > 0.0 and np.ptp(q) > 0.0 else math.nan


def _mean_times(results: pd.DataFrame, reference: pd.DataFrame) -> tuple[Floats, Floats]:
    """Return the mean times of success of both sets [s] in the worlds where both have one."""
    import pandas as pd

    means = [
        frame[frame["outcome"] == Outcome.SUCCESS].groupby("world")["time_s"].mean()
        for frame in (results, reference)
    ]
    times, reference_times = pd.concat(means, axis=1).dropna().to_numpy(dtype=np.float64).T
    return times, reference_times


def _episode(path: Path, number: int, line: dict[str, str]) -> tuple[int, str, float]:
    """Return world, outcome and time of a line. Raises InputError unless exactly one of the three flags is 1."""
    try:
        flags = [name for name in _FLAGS if int(line[name])]
        world, time = int(line["world"]), float(line["time_s"] if "time_s" in line else line["time"])
    except (KeyError, ValueError):
        raise InputError(
            f"{path}:{number}: is {' '.join(line.values())!r}: must be {' '.join(_COLUMNS)}"
        ) from None
    if len(flags) != 1:
        raise InputError(
            f"{path}:{number}: outcome is {' and '.join(flags) or 'none'}: must be exactly one of {', '.join(_FLAGS)}"
        )
    return world, flags[0], time


def _cell(path: Path, number: int, header: list[str], words: list[str], name: str) -> str:
    """Return the value of a column in a line."""
    line = dict(zip(header, words, strict=False))
    if name not in line:
        raise InputError(f"{path}:{number}: has no column {name}: must have one to choose a {name}")
    return line[name]
