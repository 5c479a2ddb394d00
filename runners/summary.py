"""From episode records to the rows of a result table.

One row per system and whatever else varies among the records (ablation, map subset, seed, swept keys); the
published figures of a system follow its own row where they were measured on the same map.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from lme.metrics import mean_std_over_runs, wilson_interval
from runners.records import COLUMNS
from runners.systems import systems as named_systems

if TYPE_CHECKING:
    import pandas as pd


class Metric(NamedTuple):
    """A column of the table. spread: show ± over runs. of_successes: failed episodes do not count."""

    key: str
    header: str
    digits: int
    spread: bool = False
    of_successes: bool = False


METRICS = (
    Metric("success", "Success", 3, spread=True),
    Metric("collision", "Collision", 3, spread=True),
    Metric("timeout", "Timeout", 3, spread=True),
    Metric("barn_metric", "BARN metric", 3, spread=True),
    Metric("time_s", "Time [s]", 1, of_successes=True),
    Metric("path_length_m", "Path [m]", 1, of_successes=True),
    Metric("spl", "SPL", 3),
)
GROUP_KEYS = ("ablation", "weights", "robot", "map", "subset", "seed")
TIMES, DASH = "\u00d7", "\u2013"  # typographic signs that are easily taken for letters
INTERVAL_HEADER = "95 % CI"
PUBLISHED_IN = {"barn": "Gazebo"}  # the paper's other maps ran in ROS Stage
USUAL = frozenset({"none", "published"})  # an ablation or weights that need no mention

Place = tuple[str, str, str]  # (system's label, map, robot)
Figures = Mapping[str, Sequence[float]]  # [mean, std] by metric


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table.

    keys: what tells this row from the others, by column. stats: (mean, std over runs) by metric; std is NaN
    where there is one run. interval: Wilson's 95 % of the success rate.
    """

    label: str
    keys: dict[str, str]
    stats: dict[str, tuple[float, float]]
    episodes: int | None = None
    worlds: int | None = None
    runs: int | None = None
    interval: tuple[float, float] | None = None
    published_map: str | None = None

    @property
    def complete(self) -> bool:
        """Every world has every run."""
        return self.episodes is None or self.episodes == (self.worlds or 0) * (self.runs or 0)


def summarise(frame: pd.DataFrame, systems: Sequence[dict[str, Any]] | None = None) -> list[Row]:
    """Rows of the table for `frame` (one line per episode), ours and then published ones.

    systems: named pairs with their published figures; the project's own unless given.
    """
    published = _published(named_systems() if systems is None else systems)
    keys = _row_keys(frame)
    grouping = ["system", *keys]
    frame = frame.assign(**{key: _as_text(frame[key]) for key in grouping})
    groups = list(frame.groupby(grouping, sort=False))
    places = [_published_place(group) for _, group in groups]
    rows = []
    for index, (values, group) in enumerate(groups):
        rows.append(_measure(group, dict(zip(grouping, values, strict=True))))
        place = places[index]
        # Once, after the last row that it is to be compared with.
        if place in published and place not in places[index + 1 :]:
            rows.append(_published_row(place, published[place], rows[-1]))
    return rows


def metrics(frame: pd.DataFrame) -> dict[str, float]:
    """Every number of the first row by name, as CSV has them: what a tracker stores of one run."""
    row = summarise(frame, systems=())[0]
    return {"episodes": float(row.episodes or 0), **numbers(row)}


def numbers(row: Row) -> dict[str, float]:
    """Means, deviations over runs (`_std`) and bounds of the success rate of a row, where it has them."""
    pairs = {
        f"{key}{end}": value
        for key, both in row.stats.items()
        for end, value in zip(("", "_std"), both, strict=True)
    }
    low, high = row.interval or (math.nan, math.nan)
    every = {**pairs, "success_low": low, "success_high": high}
    return {name: value for name, value in every.items() if not math.isnan(value)}


def title(frame: pd.DataFrame) -> str:
    """What all rows have in common: map, subset, robot."""
    common = [
        str(frame[key].iloc[0])
        for key in ("map", "subset", "robot")
        if key in frame and frame[key].nunique() == 1 and str(frame[key].iloc[0])
    ]
    worlds = f"{frame['world'].nunique()} worlds {TIMES} {frame['run'].nunique()} runs"
    return " · ".join([*common, worlds])


def notes(rows: Sequence[Row]) -> list[str]:
    """What a reader must know to read the table right."""
    lines = []
    if any(row.runs is not None and row.runs > 1 for row in rows):
        lines.append("± is the standard deviation over runs.")
    lines.append(f"{INTERVAL_HEADER}: Wilson interval of the success rate.")
    lines.append("Time and path are means over successful episodes.")
    maps = {row.published_map for row in rows if row.published_map}
    if maps:
        others = " and ".join(sorted({PUBLISHED_IN.get(name, "ROS Stage") for name in maps}))
        lines.append(f"Ours ran in this project's 2D simulator, the published ones in {others}.")
    if "barn" in maps:
        lines.append(f"The paper does not list its hundred worlds; ours are hard100, worlds 200{DASH}299.")
    unfinished = [row.label for row in rows if not row.complete]
    if unfinished:
        lines.append(f"Not finished, some worlds lack runs: {', '.join(dict.fromkeys(unfinished))}.")
    return lines


def _row_keys(frame: pd.DataFrame) -> list[str]:
    """Columns, beside `system`, that tell rows apart; none that follows from those before it."""
    swept = [column for column in frame.columns if _is_swept(frame, column)]
    keys: list[str] = []
    for key in [*(key for key in GROUP_KEYS if key in frame), *swept]:
        unusual = key in ("ablation", "weights") and not set(_as_text(frame[key])) <= USUAL
        if unusual or _distinct(frame, [*keys, key]) > _distinct(frame, keys):
            keys.append(key)
    if "run_dir" in frame and frame.duplicated(["system", *keys, "world", "run"]).any():
        keys.append("run_dir")  # two runs of one config, or of configs that differ in what nobody recorded
    return keys


def _is_swept(frame: pd.DataFrame, column: str) -> bool:
    """A config key: no column of the records, and one value per run directory."""
    if column in COLUMNS or column == "run_dir" or column.startswith("world_") or "run_dir" not in frame:
        return False
    return bool((frame.groupby("run_dir")[column].nunique(dropna=False) == 1).all())


def _distinct(frame: pd.DataFrame, columns: list[str]) -> int:
    return len(frame[["system", *columns]].drop_duplicates())


def _as_text(column: pd.Series) -> pd.Series:
    return column.astype(object).where(column.notna(), "").astype(str)


def _measure(group: pd.DataFrame, values: dict[str, str]) -> Row:
    system = values.pop("system")
    successes = group["outcome"] == "success"
    runs = int(group["run"].nunique())
    stats = {}
    for metric in METRICS:
        column = _metric_column(group, metric.key)
        chosen = successes if metric.of_successes else slice(None)
        if column is not None:
            mean, std = mean_std_over_runs(column[chosen], group["run"][chosen])
            stats[metric.key] = mean, std if runs > 1 else math.nan
    return Row(
        label=f"{system} (ours)",
        keys=values,
        stats=stats,
        episodes=len(group),
        worlds=int(group["world"].nunique()),
        runs=runs,
        interval=wilson_interval(int(successes.sum()), len(group)),
    )


def _metric_column(group: pd.DataFrame, key: str) -> pd.Series | None:
    if key in ("success", "collision", "timeout"):
        return (group["outcome"] == key).astype(float)
    return group[key] if key in group and group[key].notna().any() else None


def _published(systems: Sequence[dict[str, Any]]) -> dict[Place, Figures]:
    return {
        (system["label"], place, figures["robot"]): {key: figures[key] for key in figures if key != "robot"}
        for system in systems
        for place, figures in (system.get("published") or {}).items()
    }


def _published_place(group: pd.DataFrame) -> Place | None:
    """Where published figures for this group would be found, were there any.

    Only the whole policy compares, whoever trained it, and on BARN only the hundred hard worlds.
    """
    first = {key: str(group[key].iloc[0]) for key in ("system", *GROUP_KEYS) if key in group}
    whole = first.get("ablation", "none") == "none"
    same_worlds = first.get("map") != "barn" or first.get("subset") == "hard100"
    place = (first["system"], first.get("map", ""), first.get("robot", ""))
    return place if whole and same_worlds else None


def _published_row(place: Place, figures: Figures, ours: Row) -> Row:
    keys = {key: value if key in ("map", "subset") else "" for key, value in ours.keys.items()}
    stats = {name: (float(mean), float(std)) for name, (mean, std) in figures.items()}
    return Row(label=f"{place[0]} (published)", keys=keys, stats=stats, published_map=place[1])
