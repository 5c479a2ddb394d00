"""The leaderboard: many runs as systems × settings. Runs that were not driven alike never share a cell silently.

A setting is a map set, a robot and a simulator with all their keys. A system is the rest of the config, without seed
and number of runs.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from runners.analysis.paired import METRIC, interval_of_mean
from runners.analysis.summary import USUAL, Row, as_text, measure, numbers
from runners.config.changes import in_words
from runners.config.flatten import flatten
from runners.records.append_log import APPEND_LOG
from runners.records.launch_record import Launch, read_launch
from runners.records.parquet import EPISODES

if TYPE_CHECKING:
    import pandas as pd

PLACES = ("map", "robot", "sim")  # parts of the config that make a setting
UNKNOWN = "unknown"  # the simulator of a run without a launch record
_NEITHER = ("seed", "runs", "table")  # of the config; not of a setting, nor of a system
_NAMED = ("ablation", "weights", "scale")  # columns that are part of a system's name
_MOST_KEYS = 4  # that a name shows to tell it from others
_DIGITS = 9  # of figures that count as the same


class Setting(NamedTuple):
    """A column of the board. name: unique, and says all that is unusual. map, robot, sim: to filter by."""

    name: str
    map: str
    robot: str
    sim: str


@dataclass(frozen=True, slots=True)
class Entry:
    """One run. system: its name. row: its figures. metric_interval: 95 % of the mean BARN metric. runs: as planned.

    repeats: number of runs of the same job. same: whether they have the same figures. shown: whether it is the one of
    them to show: the newest that was finished.
    """

    run_dir: Path
    setting: Setting
    system: str
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


class _Named(NamedTuple):
    """A setting or a system. keys: what tells it from others, by dotted key; none if that is not known."""

    name: str
    keys: dict[str, Any]


class _Run(NamedTuple):
    """A run as read."""

    run_dir: Path
    frame: pd.DataFrame
    launch: Launch | None
    setting: _Named
    system: _Named

    def text(self, column: str) -> str:
        """The value that all episodes of a run share; empty without the column."""
        return _text(self.frame, column)


def entries(frames: Mapping[Path, pd.DataFrame]) -> list[Entry]:
    """An entry for each run, the newest first.

    frames: records of each run by its directory, as `read_episodes` gives them for this run alone.
    """
    runs = [_read(run_dir, frame) for run_dir, frame in frames.items()]
    settings = _unique([run.setting for run in runs])
    systems = _unique([run.system for run in runs])
    found = [_entry(*three) for three in zip(runs, settings, systems, strict=True)]
    return _with_repeats(sorted(found, key=lambda entry: entry.started, reverse=True))


def _read(run_dir: Path, frame: pd.DataFrame) -> _Run:
    launch = read_launch(run_dir)
    changes = launch.changes[0] if launch else {}
    place = filter(None, (_text(frame, key) for key in ("map", "subset", "robot")))
    sim = f"sim={_text(frame, 'sim')}" if launch else f"simulator {UNKNOWN} ({run_dir})"
    named = {key: _text(frame, key) for key in _NAMED}
    own = [f"{key} {value}" for key, value in named.items() if value not in USUAL]
    config = launch.configs[0] if launch else {}
    of_place = {key: config[key] for key in PLACES if key in config}
    of_system = {key: value for key, value in config.items() if key not in (*PLACES, *_NEITHER)}
    return _Run(
        run_dir,
        frame,
        launch,
        _Named(" · ".join([*place, sim, *_in_words(changes, of_place)]), dict(flatten(of_place))),
        _Named(
            ", ".join([_text(frame, "system"), *own, *_in_words(changes, of_system)]),
            dict(flatten(of_system)),
        ),
    )


def _text(frame: pd.DataFrame, column: str) -> str:
    return str(as_text(frame[column]).iloc[0]) if column in frame else ""


def _in_words(changes: Mapping[str, Any], part: Mapping[str, Any]) -> list[str]:
    """The changed keys of some groups of the config, in words; none if there are none."""
    words = in_words({key: value for key, value in changes.items() if key.partition(".")[0] in part})
    return [words] if words else []


def _unique(named: Sequence[_Named]) -> list[str]:
    """The names; those of different things under one name say in which keys the things differ."""
    return [
        _apart(name, values, [other for its, other in named if its == name and other]) if values else name
        for name, values in named
    ]


def _apart(name: str, values: Mapping[str, Any], namesakes: Sequence[Mapping[str, Any]]) -> str:
    keys = dict.fromkeys(key for other in namesakes for key in other)
    differing = [key for key in keys if any(other.get(key) != values.get(key) for other in namesakes)]
    shown = {key: values.get(key, "absent") for key in differing}
    if len(shown) <= _MOST_KEYS:
        return ", ".join(filter(None, (name, in_words(shown))))
    number = [other for at, other in enumerate(namesakes) if other not in namesakes[:at]].index(values) + 1
    first = in_words({key: shown[key] for key in differing[:_MOST_KEYS]})
    return f"{name}, {first} and {len(shown) - _MOST_KEYS} more (no. {number})"


def _entry(run: _Run, setting: str, system: str) -> Entry:
    launch = run.launch
    row = measure(run.frame, run.text("system"), {})
    return Entry(
        run_dir=run.run_dir,
        setting=Setting(setting, run.text("map"), run.text("robot"), run.text("sim") or UNKNOWN),
        system=system,
        row=row,
        metric_interval=interval_of_mean(run.frame, METRIC),
        seed=run.text("seed"),
        runs=int(launch.configs[0].get("runs", 0) if launch else row.runs or 0),
        started=(launch.started if launch else "") or _last_written(run.run_dir),
        code=launch.code if launch else "",
        command=_command(run.run_dir, launch),
    )


def _last_written(run_dir: Path) -> str:
    """When the records were written, for a run that does not say when it was started."""
    times = [path.stat().st_mtime for name in (EPISODES, APPEND_LOG) if (path := run_dir / name).is_file()]
    return datetime.fromtimestamp(max(times), UTC).isoformat(timespec="seconds")


def _command(run_dir: Path, launch: Launch | None) -> str:
    """The command line, without flags; that of `lme train` or `lme learn` for what it evaluated at its end."""
    parent = read_launch(run_dir.parent)
    above = parent if parent is not None and not parent.multirun else None
    given = above or launch
    return shlex.join(["lme", given.command, *given.overrides]) if given else ""


def _with_repeats(found: Sequence[Entry]) -> list[Entry]:
    """The entries, each with what is known of other runs of its job. found: the newest first."""
    groups: dict[tuple[Any, ...], list[Entry]] = {}
    for entry in found:
        groups.setdefault(_job(entry), []).append(entry)
    marked = {}
    for group in groups.values():
        same = len({_figures(entry) for entry in group}) == 1
        best = next((entry for entry in group if not entry.row.unfinished), group[0])
        for entry in group:
            marked[entry.run_dir] = replace(entry, repeats=len(group), same=same, shown=entry is best)
    return [marked[entry.run_dir] for entry in found]


def _job(entry: Entry) -> tuple[Any, ...]:
    return entry.setting, entry.system, entry.seed, entry.runs


def _figures(entry: Entry) -> str:
    """Figures of a run as text, equal for runs that ended alike."""
    rounded = {key: round(value, _DIGITS) for key, value in numbers(entry.row).items()}
    return json.dumps([entry.row.episodes, rounded], sort_keys=True)
