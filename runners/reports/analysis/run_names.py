"""Names of the runs in a comparison: their differences, and what they have in common."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from runners.config.changes import flatten
from runners.records.launch_record import Launch
from runners.reports.analysis.shared_worlds import ComparedRun
from runners.reports.analysis.summary import changed_columns, usual

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
_WHICH_WORLDS = (
    "runs",
    "table",
    "map.worlds",
    "map.subset",
    "map.count",
)  # keys of a config that change no episode


def names(runs: Sequence[ComparedRun]) -> list[str]:
    """Return a name for each run, made of its differences from the others; runs without any are named by folder."""
    differing = _telling_columns(runs)
    texts = [", ".join(_shorten([_column_text(run, column) for column in differing])) for run in runs]
    times = Counter(texts)
    folder_counts = Counter(run.run_dir.name for run in runs)
    return [
        name if times[name] == 1 and name else _with_folder(name, run, folder_counts[run.run_dir.name] == 1)
        for name, run in zip(texts, runs, strict=True)
    ]


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

    Conditions are the robot, the simulator, the rules of the map, added people, the filter, and whom the system sees.
    keys: those that differ, if they are known.
    """
    conditions = []
    for group in ("robot", "sim", "map", "crowd", "filter", "people"):
        values = list(dict.fromkeys(_condition(run, group) for run in runs))
        if len(values) > 1:
            conditions.append(f"{group}: {_listed(values)}")
            continue
        keys_of_group = {key: value for key, value in keys.items() if key.startswith(f"{group}.")}
        conditions += [
            f"{key}: {_listed(list(dict.fromkeys(map(str, value))))}" for key, value in keys_of_group.items()
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
    if column in _BARE:
        return value
    return f"{column} {value}" if value else "" if "." in column else f"no {column}"


def _shorten(texts: Sequence[str]) -> list[str]:
    nonempty = [text for text in texts if text]
    omitted = len(nonempty) - _MOST
    return nonempty if omitted <= 0 else [*nonempty[:_MOST], f"{omitted} more"]


def _with_folder(name: str, run: ComparedRun, is_enough: bool) -> str:
    folder = run.run_dir.name if is_enough else str(run.run_dir)
    return f"{name} ({folder})" if name else folder


def _listed(values: Sequence[str]) -> str:
    return " | ".join(value or "unknown" for value in values)
