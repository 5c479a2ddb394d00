"""Runs that drove the same worlds, and their names in a comparison: how they differ, and what they have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.types import Bools, Ints
from runners.config.changes import BARE_KEYS, flatten, is_config_key
from runners.config.escaping import visible
from runners.config.quoting import value_text
from runners.records.launch_record import Launch
from runners.reports.analysis.summary import ablated, changed_columns, usual

if TYPE_CHECKING:
    import pandas as pd


TASK = ("start_x_m", "start_y_m", "start_yaw_rad", "goal_x_m", "goal_y_m")
_MEASURE = "world_"  # prefix of the columns that describe a world
_SAME = 1e-6  # [m, rad]
_BARE = ("system", "map", "robot")  # whose values say what they are
_COLUMNS = (
    "system",
    "ablation",
    "weights",
    "scale",
    "filter",
    "people",
    "map",
    "robot",
    "sim",
    "crowd",
    "seed",
)
_MOST = 4  # parts of a name
# Keys of a config that change no episode.
_WHICH_WORLDS = ("runs", "table", "map.worlds", "map.subset", "map.count")


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
    def episodes(self) -> Ints:
        """World times 2³² plus the number of the run, of each episode: a million keys in 8 MB."""
        worlds, runs = (self.frame[name].to_numpy(np.int64) for name in ("world", "run"))
        codes: Ints = (worlds << 32) + runs
        return codes

    def text(self, column: str) -> str:
        """Return the value that all episodes have in a column; empty without the column."""
        return visible(str(self.frame[column].iloc[0])) if column in self.frame else ""


@dataclass(frozen=True, slots=True)
class Group:
    """Runs that share worlds with the first of them. others: each with the numbers of the shared worlds."""

    reference: ComparedRun
    others: tuple[tuple[ComparedRun, frozenset[int]], ...]

    @property
    def runs(self) -> list[ComparedRun]:
        """All runs, the reference first."""
        return [self.reference, *(run for run, _ in self.others)]


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
    common = np.intersect1d(reference.episodes, run.episodes) >> 32
    return frozenset() if worlds.isdisjoint(np.unique(common).tolist()) else worlds


def same_worlds(reference: ComparedRun, other_run: ComparedRun) -> frozenset[int]:
    """Return the numbers under which both drove the same task.

    Tasks are the same if map set, start, goal and measures of the world are. A measure that only one of them has,
    such as the number of people, makes their worlds different.
    """
    numbers = sorted(reference.worlds & other_run.worlds)
    if reference.text("map") != other_run.text("map") or not numbers:
        return frozenset()
    # Compare start and goal where both record them, and all measures of the world.
    columns = [name for name in TASK if name in reference.frame and name in other_run.frame]
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


def run_names(runs: Sequence[ComparedRun]) -> list[str]:
    """Return a name for each run, made of its differences from the others; runs without any are named by folder."""
    differing = _telling_columns(runs)
    texts = [", ".join(_shorten([_column_text(run, column) for column in differing])) for run in runs]
    times = Counter(texts)
    folder_counts = Counter(run.run_dir.name for run in runs)
    names = []
    for name, run in zip(texts, runs, strict=True):
        folder = run.run_dir.name if folder_counts[run.run_dir.name] == 1 else str(run.run_dir)
        if not name:
            names.append(folder)
        else:
            names.append(name if times[name] == 1 else f"{name} ({folder})")
    return names


def heading(runs: Sequence[ComparedRun]) -> str:
    """Return what all runs have in common: system, map, robot, and whatever is unusual."""
    first, *further_runs = runs
    common = [
        column
        for column in _columns(runs)
        if column != "seed" and all(run.text(column) == first.text(column) for run in further_runs)
    ]
    return " · ".join(
        _column_text(first, column) for column in common if first.text(column) not in usual(column)
    )


def differing_keys(launches: Sequence[Launch]) -> dict[str, list[Any]]:
    """Return the keys that decide results and differ between the configs, with the value of each run or None."""
    configs = [dict(flatten(launch.configs[0])) for launch in launches]
    keys = dict.fromkeys(key for config in configs for key in config if key not in _WHICH_WORLDS)
    values = {key: [config.get(key) for config in configs] for key in keys}
    return {key: texts for key, texts in values.items() if any(value != texts[0] for value in texts)}


def differing_conditions(keys: Mapping[str, Sequence[Any]], runs: Sequence[ComparedRun]) -> list[str]:
    """Return the conditions, besides guides and planners, that differ between the runs.

    Conditions are the robot, the simulator, the rules of the map, added people, the filter, whom the system sees, the
    cap of the commands, and from where they ramp.
    keys: those that differ, if they are known.
    """
    conditions = []
    for group in ("robot", "sim", "map", "crowd", "filter", "people", "cap", *BARE_KEYS):
        values = list(dict.fromkeys(_condition(run, group) for run in runs))
        if len(values) > 1:
            conditions.append(f"{group}: {_listed(values)}")
            continue
        keys_of_group = {key: value for key, value in keys.items() if key.startswith(f"{group}.")}
        conditions += [
            f"{key}: {_listed(list(dict.fromkeys(map(value_text, value))))}"
            for key, value in keys_of_group.items()
        ]
    return conditions


def _condition(run: ComparedRun, group: str) -> str:
    """Return the option of a run; records with a launch record name a crowd and a filter only if there is one."""
    has_none = group in ("crowd", "filter") and run.text("sim")
    return run.text(group) or ("none" if has_none else "")


def _telling_columns(runs: Sequence[ComparedRun]) -> list[str]:
    """Return the columns that differ, without those that others imply.

    Others imply the usual weights of a system, and equal keys of two groups with the same values, such as robot.v_max
    and planner.v_max.
    """
    values = {column: tuple(run.text(column) for run in runs) for column in _columns(runs)}
    differing = {column: texts for column, texts in values.items() if len(set(texts)) > 1}
    if "system" in differing and set(differing.get("weights", ())) <= usual("weights"):
        differing.pop("weights", None)
    columns = {(column.rpartition(".")[2], texts): column for column, texts in reversed(differing.items())}
    return [column for column in differing if column in columns.values()]


def _columns(runs: Sequence[ComparedRun]) -> list[str]:
    changed_keys = dict.fromkeys(column for run in runs for column in changed_columns(run.frame))
    return [*_COLUMNS, *(column for column in changed_keys if column not in _WHICH_WORLDS)]


def _column_text(run: ComparedRun, column: str) -> str:
    value = run.text(column)
    if column == "ablation" and value:
        return ablated(run.frame) or ("complete" if value in usual(column) else f"{column} {value}")
    if column in _BARE:
        return value
    return f"{column} {value}" if value else "" if is_config_key(column) else f"no {column}"


def _shorten(texts: Sequence[str]) -> list[str]:
    nonempty = [text for text in texts if text]
    omitted = len(nonempty) - _MOST
    return nonempty if omitted <= 0 else [*nonempty[:_MOST], f"{omitted} more"]


def _listed(values: Sequence[str]) -> str:
    return " | ".join(value or "unknown" for value in values)
