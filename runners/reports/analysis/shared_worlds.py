"""Runs that drove the same worlds, and the worlds in which they do worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.types import Bools
from runners.config.escaping import visible
from runners.records.episode_record import EpisodeKey
from runners.reports.analysis.paired import SUCCESS

if TYPE_CHECKING:
    import pandas as pd


_TASK = ("start_x_m", "start_y_m", "start_yaw_rad", "goal_x_m", "goal_y_m")
_MEASURE = "world_"  # prefix of the columns that describe a world
_SAME = 1e-6  # [m, rad]
_Key = tuple[str, EpisodeKey]


@dataclass(frozen=True, slots=True)
class ComparedRun:
    """A run and its records."""

    run_dir: Path
    frame: pd.DataFrame

    @property
    def worlds(self) -> set[int]:
        """Numbers of the worlds that the run drove."""
        return set(self.frame["world"])

    @property
    def episodes(self) -> set[tuple[int, int]]:
        """World and number of the run, of each episode."""
        return set(zip(self.frame["world"], self.frame["run"], strict=True))

    def text(self, column: str) -> str:
        """Return the value that all episodes have in a column; empty without the column."""
        return visible(str(self.frame[column].iloc[0])) if column in self.frame else ""


@dataclass(frozen=True, slots=True)
class Group:
    """Runs that share worlds with the first of them. others: each with the numbers of the shared worlds."""

    reference: ComparedRun
    others: tuple[tuple[ComparedRun, frozenset[int]], ...]


def groups(runs: Sequence[ComparedRun]) -> list[Group]:
    """Return the runs grouped by shared worlds, in their order. A run that shares none is a group without others.

    Runs share worlds if they have an episode in common to compare, with the same world and number of the run.
    """
    run_groups = []
    remaining = list(runs)
    # The first run that is left is the reference of all that share worlds with it.
    while remaining:
        reference, *candidates = remaining
        shared = [(run, _with_pairs(same_worlds(reference, run), reference, run)) for run in candidates]
        run_groups.append(Group(reference, tuple((run, worlds) for run, worlds in shared if worlds)))
        remaining = [run for run, worlds in shared if not worlds]
    return run_groups


def _with_pairs(worlds: frozenset[int], reference: ComparedRun, run: ComparedRun) -> frozenset[int]:
    """Return the worlds if the runs have an episode in common in one of them; otherwise none."""
    return worlds if any(world in worlds for world, _ in reference.episodes & run.episodes) else frozenset()


def same_worlds(reference: ComparedRun, other_run: ComparedRun) -> frozenset[int]:
    """Return the numbers under which both drove the same task.

    Tasks are the same if map set, start, goal and measures of the world are. A measure that only one of them has,
    such as the number of people, makes their worlds different.
    """
    numbers = sorted(reference.worlds & other_run.worlds)
    if reference.text("map") != other_run.text("map") or not numbers:
        return frozenset()
    # Compare start and goal where both record them, and all measures of the world.
    columns = [name for name in _TASK if name in reference.frame and name in other_run.frame]
    measures = dict.fromkeys(
        name for run in (reference, other_run) for name in run.frame if name.startswith(_MEASURE)
    )
    first, second = (
        run.frame.drop_duplicates("world").set_index("world").reindex(numbers, columns=[*columns, *measures])
        for run in (reference, other_run)
    )
    is_same = np.ones(len(numbers), dtype=bool)
    for name in first:
        is_same &= _equal_values(first[name], second[name])
    return frozenset(number for number, is_equal in zip(numbers, is_same, strict=True) if is_equal)


def _equal_values(values: pd.Series, reference_values: pd.Series) -> Bools:
    """Return where two columns agree: numbers except for rounding, texts exactly. Missing values agree."""
    from pandas.api.types import is_numeric_dtype

    values, reference_values = values.infer_objects(), reference_values.infer_objects()
    if is_numeric_dtype(values) and is_numeric_dtype(reference_values):
        first, second = values.to_numpy(float), reference_values.to_numpy(float)
        is_close: Bools = np.isclose(first, second, rtol=0.0, atol=_SAME, equal_nan=True)
        return is_close
    return np.asarray((values == reference_values) | (values.isna() & reference_values.isna()))


@dataclass(frozen=True, slots=True)
class WorstWorld:
    """A world, represented by its worst episode. outcome, reward, time_s [s]: of this episode.

    runs, failed: number of episodes, and of failed ones. start_failed: failed ones of the start; None if the start is
    the result. lost: failed episodes of the result in which the start succeeded.
    """

    run_dir: Path
    key: EpisodeKey
    outcome: str
    reward: float
    time_s: float
    runs: int
    failed: int
    start_failed: int | None
    lost: int


def worst_worlds(frame: pd.DataFrame, start: pd.DataFrame | None, count: int) -> list[WorstWorld]:
    """Return at most `count` worlds: those with failures first, then those with the lowest reward.

    Among equal ones, those where the start succeeded most often come first. frame, start: records with their
    `run_dir` and the column `reward`; maps have directories of the same name. start: None if the start is the result.
    """
    start_successes = None if start is None else _succeeded_keys(start)
    by_world: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for row in frame.to_dict("records"):
        by_world.setdefault((str(row["run_dir"]), int(row["world"])), []).append(row)
    return sorted((_world(rows, start_successes) for rows in by_world.values()), key=_order)[:count]


def regressions(frame: pd.DataFrame, start: pd.DataFrame) -> int:
    """Return the number of episodes in which the result fails where the start succeeded."""
    start_successes = _succeeded_keys(start)
    return sum(_failed(row) and _key(row) in start_successes for row in frame.to_dict("records"))


def _world(rows: Sequence[Mapping[str, Any]], start_successes: set[_Key] | None) -> WorstWorld:
    failed = [row for row in rows if _failed(row)]
    regressed = [row for row in failed if start_successes is not None and _key(row) in start_successes]
    worst = min(rows, key=lambda row: (not _failed(row), row["reward"], row not in regressed))
    return WorstWorld(
        Path(worst["run_dir"]),
        EpisodeKey.of(worst),
        str(worst["outcome"]),
        float(worst["reward"]),
        float(worst["time_s"]),
        len(rows),
        len(failed),
        None if start_successes is None else sum(_key(row) not in start_successes for row in rows),
        len(regressed),
    )


def _order(world: WorstWorld) -> tuple[bool, float, int, int]:
    return world.outcome == SUCCESS, world.reward, -world.lost, -world.failed


def _failed(row: Mapping[str, Any]) -> bool:
    return bool(row["outcome"] != SUCCESS)


def _succeeded_keys(start: pd.DataFrame) -> set[_Key]:
    """Return the episodes in which the start succeeded."""
    return {_key(row) for row in start.to_dict("records") if not _failed(row)}


def _key(row: Mapping[str, Any]) -> _Key:
    """Return what an episode of the result and one of the start have in common: the map and the key."""
    return Path(row["run_dir"]).name, EpisodeKey.of(row)
