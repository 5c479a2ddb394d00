"""The leaderboard: many runs as systems × settings. Runs under different conditions never share a cell silently.

A setting is a map set, a robot, a simulator and a crowd with all their keys. A system is a guide, a planner and a
filter with all theirs, whom it sees (`people`), and what changes it: ablation, weights, scale, a changed cap or ramp.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from lme.errors import InputError
from lme.worlds.barn.map_set import FRESH, OFFICIAL
from runners.config.changes import BARE_KEYS, describe_changes, flatten
from runners.records.episode_record import APPEND_LOG, CUSTOM_SUBSET
from runners.records.launch_record import Launch, read_launch, sweep_launch
from runners.records.parquet import EPISODES
from runners.records.run_directories import NOT_AS_WRITTEN, not_as_written
from runners.reports.analysis.paired import METRIC, interval_of_mean
from runners.reports.analysis.summary import Row, ablated, as_text, measure, numbers, usual

if TYPE_CHECKING:
    import pandas as pd

PLACES = ("map", "robot", "sim", "crowd")  # parts of the config that make a setting
UNKNOWN = "unknown"  # the simulator of a run without a launch record
SYSTEM = ("guide", "planner", "filter", "people", "ablation", "weights", "scale")  # parts that make a system
_NAMED = ("ablation", "weights", "scale", "filter", "people")  # columns that are part of a system's name
_OF_COMMANDS = ("cap.", *BARE_KEYS)  # keys outside of these parts, which belong to the system
_MAX_KEYS = 4  # that a name shows to tell it from others
_DIGITS = 9  # figures that agree to these digits count as equal


class Setting(NamedTuple):
    """The conditions of a run. traits: what is unusual, or tells it from other settings, such as "robot.v_max=1"."""

    map: str
    subset: str
    robot: str
    sim: str
    traits: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        sim = f"simulator {UNKNOWN}" if self.sim == UNKNOWN else f"sim={self.sim}"
        return " · ".join(filter(None, (self.map or "no map set", self.subset, self.robot, sim)))


class BoardSystem(NamedTuple):
    """The evaluated system. traits: what is unusual, or tells it from other systems, such as "ablation no_c_o"."""

    label: str
    traits: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return ", ".join([self.label, *self.traits])


@dataclass(frozen=True, slots=True)
class BoardEntry:
    """A run. row: its figures. metric_interval: 95 % interval of the mean BARN metric. runs: as planned.

    repeats: number of runs of the same job. same: whether they have the same figures. shown: whether it is the one to
    show, which is the newest finished one.
    """

    run_dir: Path
    setting: Setting
    system: BoardSystem
    row: Row
    metric_interval: tuple[float, float]
    seed: str
    runs: int
    started: str
    code: str
    command: str
    repeats: int = 1
    same: bool = True
    shown: bool = True

    @property
    def job(self) -> tuple[Any, ...]:
        """The properties that runs of one job have in common."""
        return self.setting, self.system, self.seed, self.runs


_Name = TypeVar("_Name", Setting, BoardSystem)


class _ReadRun(NamedTuple):
    """A run as read. of_setting, of_system: parts of its config by dotted key; empty without a launch record."""

    run_dir: Path
    frame: pd.DataFrame
    launch: Launch | None
    setting: Setting
    system: BoardSystem
    of_setting: dict[str, Any]
    of_system: dict[str, Any]

    def text(self, column: str) -> str:
        """Return the value that all episodes of a run share; empty without the column."""
        return _text(self.frame, column)


def entries(frames: Mapping[Path, pd.DataFrame], problems: list[str] | None = None) -> list[BoardEntry]:
    """Return an entry for each run, the newest first.

    frames: records of each run by its directory, as `read_episodes` returns them for this run alone. problems: gets a
    line for each run whose files hold something that lme does not write; such a run is left out. Without it, such a
    run raises.
    """
    # Read all runs, and put aside those that lme did not write.
    runs = []
    for run_dir, frame in frames.items():
        try:
            run = _read(run_dir, frame)
            runs.append((run, _entry(run)))
        except NOT_AS_WRITTEN as error:
            if problems is None:
                raise
            problems.append(not_as_written(run_dir, error))
    # Runs of equal names may differ in other keys: add those to their names.
    settings = _by_name((run.setting, run.of_setting) for run, _ in runs)
    systems = _by_name((run.system, run.of_system) for run, _ in runs)
    unordered = [
        replace(
            entry,
            setting=run.setting._replace(
                traits=run.setting.traits + _distinguishing(run.of_setting, settings[run.setting])
            ),
            system=run.system._replace(
                traits=run.system.traits + _distinguishing(run.of_system, systems[run.system])
            ),
        )
        for run, entry in runs
    ]
    return _with_repeats(sorted(unordered, key=lambda entry: entry.started, reverse=True))


def _read(run_dir: Path, frame: pd.DataFrame) -> _ReadRun:
    launch = read_launch(run_dir)
    changes = launch.changes[0] if launch else {}
    map_set, subset, robot = (_text(frame, key) for key in ("map", "subset", "robot"))
    config = launch.configs[0] if launch else {}
    # The keys that make the setting, and those that make the system.
    of_setting = {key: config[key] for key in PLACES if key in config}
    if subset == CUSTOM_SUBSET and isinstance(of_setting.get("map"), dict):
        subset, of_setting["map"] = _by_worlds(subset, of_setting["map"], frame)
    setting_keys = dict(flatten(of_setting))
    system_keys = dict(flatten({key: config[key] for key in SYSTEM if key in config}))
    sim = _text(frame, "sim") if launch else UNKNOWN
    # What a name has to show: changed keys, and unusual options.
    traits = _changed_settings(changes, setting_keys) if launch else (f"no launch record: {run_dir}",)
    of_commands = {key: changes[key] for key in changes if key.startswith(_OF_COMMANDS)}
    crowd, options = _unusual_values(frame, ("crowd",)), _unusual_values(frame, _NAMED)
    return _ReadRun(
        run_dir,
        frame,
        launch,
        Setting(map_set, subset, robot, sim, (*crowd, *traits)),
        BoardSystem(
            _text(frame, "system"), (*options, *_changed_settings(changes, system_keys | of_commands))
        ),
        setting_keys,
        system_keys,
    )


def _by_worlds(subset: str, map_set: Mapping[str, Any], frame: pd.DataFrame) -> tuple[str, dict[str, Any]]:
    """Return the subset and the keys of a map set of which a run drove chosen worlds, with these worlds.

    `lme figure` drives the worlds that it draws and does not name them here. The number of an official world
    identifies it whatever subset is named beside it; the number of a fresh world does not.
    """
    subset_name = map_set.get("subset")
    needless = ("subset", "count") if subset_name in OFFICIAL else ()
    worlds = map_set.get("worlds") or sorted(map(int, set(frame["world"])))
    settings = {key: value for key, value in map_set.items() if key not in needless}
    return subset_name if subset_name in FRESH else subset, settings | {"worlds": worlds}


def _text(frame: pd.DataFrame, column: str) -> str:
    return str(as_text(frame[column]).iloc[0]) if column in frame else ""


def _unusual_values(frame: pd.DataFrame, columns: Iterable[str]) -> tuple[str, ...]:
    """Return the columns whose value a name has to show, each as text, such as "filter stopping" or "without c_o"."""
    values = {key: _text(frame, key) for key in columns}
    words = {"ablation": ablated(frame)}
    return tuple(
        words.get(key) or f"{key} {value}" for key, value in values.items() if value not in usual(key)
    )


def _changed_settings(changes: Mapping[str, Any], keys: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the changed keys of a part of the config that have no column in a name, each as text."""
    return _each_as_text({key: changes[key] for key in changes if key in keys and key not in _NAMED})


def _each_as_text(values: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(describe_changes({key: value}) for key, value in values.items())


def _by_name(systems: Iterable[tuple[_Name, dict[str, Any]]]) -> dict[_Name, list[dict[str, Any]]]:
    """Return the different configs of each name, without those whose keys are unknown."""
    by_name: dict[_Name, list[dict[str, Any]]] = {}
    for name, values in systems:
        namesakes = by_name.setdefault(name, [])
        if values and values not in namesakes:
            namesakes.append(values)
    return by_name


def _distinguishing(values: Mapping[str, Any], namesakes: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the keys in which a config differs from its namesakes, as text; none if its keys are unknown."""
    if not values:
        return ()
    keys = dict.fromkeys(key for config in namesakes for key in config)
    differing = [key for key in keys if any(config.get(key) != values.get(key) for config in namesakes)]
    values_shown = {key: values.get(key, "absent") for key in differing}
    # Of too many keys, name the first and count the rest; a number tells the namesakes apart.
    if len(values_shown) <= _MAX_KEYS:
        return _each_as_text(values_shown)
    settings = _each_as_text({key: values_shown[key] for key in differing[:_MAX_KEYS]})
    return (*settings, f"{len(values_shown) - _MAX_KEYS} more (no. {namesakes.index(values) + 1})")


def _entry(run: _ReadRun) -> BoardEntry:
    launch = run.launch
    row = measure(run.frame, run.text("system"), {})
    return BoardEntry(
        run_dir=run.run_dir,
        setting=run.setting,
        system=run.system,
        row=row,
        metric_interval=interval_of_mean(run.frame, METRIC),
        seed=run.text("seed"),
        runs=int(launch.configs[0].get("runs", 0) if launch else row.runs or 0),
        started=(launch.started if launch else "") or _last_written(run.run_dir),
        code=launch.code if launch else "",
        command=_command(run.run_dir, launch),
    )


def _last_written(run_dir: Path) -> str:
    """Return the time at which the records were written, for a run without a start time."""
    times = [path.stat().st_mtime for name in (EPISODES, APPEND_LOG) if (path := run_dir / name).is_file()]
    return datetime.fromtimestamp(max(times), UTC).isoformat(timespec="seconds")


def _command(run_dir: Path, launch: Launch | None) -> str:
    """Return the command that drove a run; that of `lme train` or `lme learn` for the evaluation at its end."""
    try:
        parent = sweep_launch(run_dir.parent)
    except InputError as error:  # the parent only says how the run was started
        warnings.warn(str(error), stacklevel=2)
        parent = None
    sweep = parent if parent is not None and not parent.multirun else None
    record = sweep or launch
    return record.command_line if record else ""


def _with_repeats(unmarked: Sequence[BoardEntry]) -> list[BoardEntry]:
    """Return the entries, each with what is known about other runs of its job. unmarked: the newest first."""
    groups: dict[tuple[Any, ...], list[BoardEntry]] = {}
    for entry in unmarked:
        groups.setdefault(entry.job, []).append(entry)
    by_run_dir = {}
    # Show the newest finished run of each job, and say whether the others agree with it.
    for group in groups.values():
        is_same = len({_figures(entry) for entry in group}) == 1
        best = next((entry for entry in group if not entry.row.unfinished), group[0])
        for entry in group:
            by_run_dir[entry.run_dir] = replace(entry, repeats=len(group), same=is_same, shown=entry is best)
    return [by_run_dir[entry.run_dir] for entry in unmarked]


def _figures(entry: BoardEntry) -> str:
    """Return the figures of a run as text, which is equal for runs with the same results."""
    rounded = {key: round(value, _DIGITS) for key, value in numbers(entry.row).items()}
    return json.dumps([entry.row.episodes, rounded], sort_keys=True)
