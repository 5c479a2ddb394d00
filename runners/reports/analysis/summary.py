"""Summaries of episode records as the rows of a result table.

There is one row for each combination of the system and other values that vary (ablation, map subset, seed, swept
keys). The published figures of a system follow its row if they were measured in the same setting.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lme.metrics import interval_over_worlds, mean_std_over_runs
from lme.perception.people.source import People
from runners.config.changes import is_config_key
from runners.config.schema import PUBLISHED_MARK
from runners.config.systems import System, ablation_labels, describe_ablation
from runners.config.systems import systems as named_systems
from runners.records.launch_record import read_launch
from runners.records.records import ABLATED, PLANNED_EPISODES, PLANNED_WORLDS, planned
from runners.reports.analysis import published

if TYPE_CHECKING:
    import pandas as pd


class Metric(NamedTuple):
    """A column of the table.

    spread: whether to show ± over runs. of_successes: whether only successful episodes count. spare: whether the
    column is omitted first on a narrow terminal. measured: whether episodes without the value are ignored; otherwise
    one of them leaves the column empty.
    """

    key: str
    header: str
    digits: int
    spread: bool = False
    of_successes: bool = False
    spare: bool = False
    measured: bool = False


SMOOTHNESS = "mean_abs_domega_radps"
BARN_METRIC = "barn_metric"
METRIC_COLUMNS = ("map", "world_cylinders", "world_family")  # those that say whether a map has the metric
METRICS = (
    Metric("success", "Success", 3, spread=True),
    Metric("collision", "Collision", 3, spread=True),
    Metric("timeout", "Timeout", 3, spread=True),
    Metric(BARN_METRIC, "BARN metric", 3, spread=True),  # of BARN's worlds alone
    Metric("time_s", "Time [s]", 1, of_successes=True),
    Metric("path_length_m", "Path [m]", 1, of_successes=True, spare=True),
    Metric("spl", "SPL", 3, spare=True),
    Metric(SMOOTHNESS, "|Δω| [rad/s]", 3),
    # of worlds with people alone (lme.simulation.social)
    Metric("robot_on_person_collision", "Robot on person", 3),
    Metric("person_on_robot_collision", "Person on robot", 3),
    Metric("minimum_distance_to_people_m", "Min. distance [m]", 2, measured=True),
    Metric("intimate_space_intrusions", "Intimate", 3, spare=True),
    Metric("personal_space_intrusions", "Personal", 3, spare=True),
    Metric("path_irregularity_rad", "Irregularity [rad]", 2, spare=True),
    Metric("time_against_alone", "Time against alone", 2, of_successes=True, measured=True),
)
# shown even if all rows have the same value, unless it is usual
NAMED = ("ablation", "weights", "scale", "filter", "people", "sim", "crowd")
SETTING = ("robot", "map", "subset", "seed")  # the same for all systems of a fair comparison
GROUP_KEYS = (*NAMED, *SETTING)
TIMES, DASH = "\u00d7", "\u2013"  # typographic signs that look like letters
INTERVAL_HEADER = "95 % CI"
INTERVAL_NOTE = "Wilson interval of the success rate; worlds are independent, runs of one world are not."
GLOBAL_PLANNER = {"": "no", "observed": "yes", "known": "yes, true map"}  # by the guide's global_map
_OF_BARN = ("barn", "dynabarn")  # the benchmark's scripts score both with the metric
_USUAL = frozenset({"none", "published", "lme_plus", "fast", ""})  # LME+ has no other weight set of ours
_USUAL_PEOPLE = frozenset({str(People.truth), ""})  # none: the system sees nobody


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table.

    keys: values that distinguish this row from others, by column. stats: (mean, std over runs) by metric; std is NaN
    for a single run. interval: 95 % interval of the success rate. global_planner: a value of GLOBAL_PLANNER.
    ablated: the label of its ablation, "without c_o"; empty if there is none, or if `label` includes it.
    changes: "key=value, …" of keys, other than `keys`, that differ from the files of their options. unfinished: how
    much of the plan was driven, such as "12 of 100 worlds"; empty if all of it. source: where published figures are
    from; empty for driven rows, and for the paper's. sim: the simulator; empty for published figures. unpublished:
    why the published figures of its system do not follow it; empty where there are none.
    """

    label: str
    keys: dict[str, str]
    stats: dict[str, tuple[float, float]]
    global_planner: str = "no"
    episodes: int | None = None
    worlds: int | None = None
    runs: int | None = None
    interval: tuple[float, float] | None = None
    published_map: str | None = None
    changes: str = ""
    unfinished: str = ""
    ablated: str = ""
    source: str = ""
    sim: str = ""
    unpublished: str = ""

    @property
    def name(self) -> str:
        """The row's name in the table: its label, with its ablation and the share that was driven."""
        label = f"{self.label} {self.ablated}" if self.ablated else self.label
        return f"{label}, {self.unfinished}" if self.unfinished else label


def summarise(
    frame: pd.DataFrame,
    order: Sequence[str] = (),
    systems: Mapping[str, System] | None = None,
) -> list[Row]:
    """Return the rows of the table for `frame` (one line per episode): each system's own, then its published ones.

    order: names of systems whose rows come first, in this order. A system without episodes has only its published
    figures. systems: named systems by name; by default those of `conf/system/`.
    """
    systems = named_systems() if systems is None else systems
    figures = published.figures(systems)
    keys = row_keys(frame)
    grouping = ["system", *keys]
    # Measure a row for each combination of values, and find the setting that it can be compared in.
    own_rows: dict[str, list[tuple[Row, published.DrivenSetting | None]]] = {name: [] for name in order}
    for values, group in groups(frame, grouping):
        row = measure(group, values[0], dict(zip(keys, values[1:], strict=True)))
        name, setting = _system_name(group, systems), published.setting_of(group)
        reason = setting.why_none(name, figures) if setting else ""
        row = replace(row, unpublished=reason)
        own_rows.setdefault(name, []).append((row, setting))
    # Put the published figures behind the rows of their system.
    settings = {setting: row for rows in own_rows.values() for row, setting in rows if setting}
    return [row for name, rows in own_rows.items() for row in _with_published(name, rows, settings, figures)]


def rows_of_runs(frame: pd.DataFrame, run_dirs: Sequence[Path], is_sweep: bool) -> list[Row]:
    """Return the rows of the table of recorded runs, in the order that the config of a sweep sets."""
    launch = read_launch(run_dirs[0])
    if launch is None:
        return summarise(frame)
    order = launch.configs[0].get("table", []) if is_sweep else []
    return summarise(frame, order, named_systems(launch.folders))


def metrics(frame: pd.DataFrame) -> dict[str, float]:
    """Return all numbers of the first row by name, as in the CSV: the metrics of one tracked run."""
    row = summarise(frame, systems={})[0]
    return {"episodes": float(row.episodes or 0), **numbers(row)}


def metrics_by_map(frame: pd.DataFrame) -> dict[str, float]:
    """Return the metrics of one tracked run: of several maps, the means over the maps, and below MAP/ those of each."""
    by_map = {name: metrics(frame[frame["map"] == name]) for name in dict.fromkeys(frame["map"])}
    first, *others = by_map.values()
    if not others:
        return first
    means = {
        metric.key: fmean(values[metric.key] for values in by_map.values())
        for metric in METRICS
        if all(metric.key in values for values in by_map.values())
    }
    of_maps = {f"{name}/{key}": value for name, values in by_map.items() for key, value in values.items()}
    return {"episodes": float(len(frame)), **means, **of_maps}


def measure(group: pd.DataFrame, system: str, keys: dict[str, str]) -> Row:
    """Return the row of the table for these records. keys: values that distinguish it from other rows, by column."""
    successes = group["outcome"] == "success"
    worlds, runs = int(group["world"].nunique()), int(group["run"].nunique())
    stats = {}
    # Mean and standard deviation over runs, of the episodes that count for the metric.
    for metric in METRICS:
        column = _metric_column(group, metric.key)
        if column is not None:
            is_counted = (successes | (not metric.of_successes)) & (column.notna() | (not metric.measured))
            mean, std = mean_std_over_runs(column, group["run"], is_counted)
            stats[metric.key] = mean, std if runs > 1 else math.nan
    global_map = str(group["global_map"].iloc[0]) if "global_map" in group else ""
    return Row(
        label=system,
        keys=keys,
        stats=stats,
        global_planner=GLOBAL_PLANNER.get(global_map, "no"),
        episodes=len(group),
        worlds=worlds,
        runs=runs,
        interval=interval_over_worlds(successes, group["world"]),
        changes=_changes(group, keys),
        unfinished=_unfinished(group, worlds, runs),
        ablated=ablated(group),
        sim=str(group["sim"].iloc[0]) if "sim" in group else "",
    )


def numbers(row: Row) -> dict[str, float]:
    """Return the means, deviations over runs (`_std`) and bounds of the success rate of a row, if it has them."""
    pairs = {
        f"{key}{suffix}": value
        for key, mean_and_std in row.stats.items()
        for suffix, value in zip(("", "_std"), mean_and_std, strict=True)
    }
    low, high = row.interval or (math.nan, math.nan)
    values = {**pairs, "success_low": low, "success_high": high}
    return {name: value for name, value in values.items() if not math.isnan(value)}


def row_keys(frame: pd.DataFrame) -> list[str]:
    """Return the columns besides `system` that distinguish rows: those that vary, or have unusual values."""
    candidates = [*(key for key in GROUP_KEYS if key in frame), *changed_columns(frame)]
    kinds = frame[["system", *candidates]].drop_duplicates()  # few, of a million episodes
    keys = [
        key
        for key in candidates
        if (key in NAMED and not set(as_text(kinds[key])) <= usual(key)) or _varies(kinds, key)
    ]
    if "run_dir" in frame and frame.duplicated(["system", *keys, "world", "run"]).any():
        # two runs of the same config, or of configs that differ in a key without a column
        keys.append("run_dir")
    return keys


def usual(key: str) -> frozenset[str]:
    """Return the values of a column that need not be shown."""
    return _USUAL_PEOPLE if key == "people" else _USUAL


def changed_columns(frame: pd.DataFrame) -> list[str]:
    """Return the columns for config keys that some run has changed."""
    return [column for column in frame.columns if is_config_key(column)]


def barn_metric(frame: pd.DataFrame) -> pd.Series:
    """Return the BARN metric of each episode; NaN on maps outside the benchmark, whose speed and limit it assumes.

    BARN's worlds are recognised by the map's name, or in a user's own option by their cylinders, which no other map
    set counts except the families of the cold trial.
    """
    columns = frame.reindex(columns=METRIC_COLUMNS)
    is_known = columns.notna()
    # A world with cylinders but without a family is one of BARN's under another name.
    cylinders = is_known["world_cylinders"] & ~is_known["world_family"]
    return frame[BARN_METRIC].where(columns["map"].isin(_OF_BARN) | ~is_known["map"] | cylinders)


def as_text(column: pd.Series) -> pd.Series:
    """Return the values of a column as text, as a table shows them; empty for a missing value."""
    import pandas as pd

    codes, values = pd.factorize(column)
    texts = np.array([*map(str, values.astype(object)), ""], dtype=object)  # the last is for the code -1
    return pd.Series(texts[codes], column.index, dtype=object, name=column.name)


def groups(frame: pd.DataFrame, columns: Sequence[str]) -> Iterator[tuple[tuple[str, ...], pd.DataFrame]]:
    """Yield each combination of the columns' texts and its records, in the order of the first ones."""
    texts = frame.assign(**{key: as_text(frame[key]) for key in columns})
    kinds = texts[list(columns)].drop_duplicates()
    if len(kinds) == 1:  # all of them, which need no copy
        yield tuple(kinds.iloc[0]), texts
        return
    yield from texts.groupby(list(columns), sort=False)


def _with_published(
    name: str,
    own_rows: Sequence[tuple[Row, published.DrivenSetting | None]],
    settings: Mapping[published.DrivenSetting, Row],
    figures: Mapping[tuple[str, published.PublishedSetting], published.Figures],
) -> Iterator[Row]:
    """Yield a system's rows, and its published figures for each setting after the last row of that setting.

    settings: every setting of the records, with one of its rows. A system without rows gets its figures for all.
    """
    for index, (row, setting) in enumerate(own_rows):
        yield row
        source = setting.figures_of(name, figures) if setting else None
        if (
            setting
            and source
            and setting not in (later_setting for _, later_setting in own_rows[index + 1 :])
        ):
            yield _published_row(source, setting, row)
    # A system without rows of its own: its figures for every setting of the records.
    if not own_rows:
        for setting, own_row in settings.items():
            source = setting.figures_of(name, figures)
            if source:
                yield _published_row(source, setting, own_row)


def _system_name(group: pd.DataFrame, systems: Mapping[str, System]) -> str:
    """Return the name of the system with this label and pair; the label if there is none.

    A user may give another pair the label of a shipped system. Records without the pair have the label alone.
    """
    episode = group.iloc[0]
    label, pair = str(episode["system"]), (episode.get("guide"), episode.get("planner"))
    names = [
        name
        for name, system in systems.items()
        if system.label == label and pair in ((system.guide, system.planner), (None, None))
    ]
    return [label, *names][-1]


def _published_row(source: published.Figures, setting: published.DrivenSetting, own_row: Row) -> Row:
    keys = {key: value if key in ("map", "subset") else "" for key, value in own_row.keys.items()}
    return Row(
        label=source.label + PUBLISHED_MARK,
        keys=keys,
        stats=source.stats,
        global_planner=GLOBAL_PLANNER["observed" if source.global_planner else ""],
        published_map=setting.map,
        source=source.source,
    )


def ablated(group: pd.DataFrame) -> str:
    """Return the ablation of these records in words; empty if there is none, or if the system's name says it.

    Records without a launch record are of the shipped ablations.
    """
    episode = group.iloc[0]
    label = episode.get(ABLATED)
    if not isinstance(label, str):
        choice = str(episode.get("ablation", ""))
        label = describe_ablation(choice, ablation_labels(choices=[choice]))
    # The label of lme_no_c_t says it already, as do those of systems with an ablation in records made before.
    return "" if str(episode["system"]).endswith(label) else label


def _unfinished(group: pd.DataFrame, worlds: int, runs: int) -> str:
    """Return "12 of 100 worlds", or "250 of 300 episodes" if no world is missing; empty for a finished run."""
    all_worlds = max(worlds, planned(group, PLANNED_WORLDS))
    if worlds < all_worlds:
        return f"{worlds} of {all_worlds} worlds"
    all_episodes = max(worlds * runs, planned(group, PLANNED_EPISODES))
    return f"{len(group)} of {all_episodes} episodes" if len(group) < all_episodes else ""


def _changes(group: pd.DataFrame, keys: Iterable[str]) -> str:
    text = str(group["changes"].iloc[0]) if "changes" in group else ""
    return ", ".join(change for change in text.split(", ") if change.partition("=")[0] not in keys)


def _varies(frame: pd.DataFrame, column: str) -> bool:
    """Return whether a column has several values: a column of SETTING in the table, any other within a system."""
    if column in SETTING:
        return bool(frame[column].nunique(dropna=False) > 1)
    return bool((frame.groupby("system")[column].nunique(dropna=False) > 1).any())


def _metric_column(group: pd.DataFrame, key: str) -> pd.Series | None:
    if key in ("success", "collision", "timeout"):
        return (group["outcome"] == key).astype(float)
    column = barn_metric(group) if key == BARN_METRIC and key in group else group.get(key)
    return column if column is not None and column.notna().any() else None
