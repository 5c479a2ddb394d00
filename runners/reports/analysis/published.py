"""Published figures of the named systems, and the records with which they can be compared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from runners.config.systems import System
from runners.records.records import PLANNED_WORLDS, planned

if TYPE_CHECKING:
    import pandas as pd

    from runners.reports.analysis.summary import Row

PUBLISHED_IN = {"barn": "Gazebo", "barn_official50": "Gazebo"}  # the paper ran its other maps in ROS Stage
BARN_SUBSET = "lab100"  # the worlds of the paper's BARN figures, as far as is known
_BARN_PLACES = {
    BARN_SUBSET: "barn",
    "official50": "barn_official50",
}  # what conf/published.yaml calls these subsets
_SIMULATORS = {"physics": "simulator with rigid bodies", "skid": "simulator of skidding wheels"}  # others: 2D
_AS_PUBLISHED = {"ablation": "none", "filter": "none", "crowd": "none", "people": "truth"}
TEXTS = ("robots", "source", "formula")  # of published figures, besides metrics


class PublishedSetting(NamedTuple):
    """The map and the robot of a measurement."""

    map: str
    robot: str


class DrivenSetting(NamedTuple):
    """The map of records, and the shipped robots whose values their robot has.

    robot: its name. difference: from the shipped robot of that name.
    """

    map: str
    robots: tuple[str, ...]
    robot: str
    difference: str = ""

    def figures_of(
        self, name: str, published: Mapping[tuple[str, PublishedSetting], Figures]
    ) -> Figures | None:
        """Return the published figures of a system that can be compared with these records, if any."""
        keys = [(name, PublishedSetting(self.map, robot)) for robot in self.robots]
        return next((published[key] for key in keys if key in published), None)

    def why_none(self, name: str, published: Mapping[tuple[str, PublishedSetting], Figures]) -> str:
        """Return why figures of a robot of this name are not compared with these records; empty if there are none."""
        if (
            self.figures_of(name, published)
            or (name, PublishedSetting(self.map, self.robot)) not in published
        ):
            return ""
        return self.difference or f"the robot {self.robot} is not the shipped one"


class Figures(NamedTuple):
    """Published figures. label: without our system's settings in brackets.

    stats: (mean, standard deviation) by metric; a deviation that was not published is NaN. source: the log that they
    were taken from, with the formula of its BARN metric; empty for figures of the paper.
    """

    label: str
    global_planner: bool
    stats: dict[str, tuple[float, float]]
    source: str = ""


def figures(systems: Mapping[str, System]) -> dict[tuple[str, PublishedSetting], Figures]:
    """Return the published figures by the name of the system in `conf/system/` and by setting."""
    figures_by_setting = {}
    for name, system in systems.items():
        for map_name, entry in system.published.items():
            # A metric is [mean, std], or [mean] if no deviation was published.
            stats = {
                key: (float(values[0]), float(values[1]) if len(values) > 1 else math.nan)
                for key, values in entry.items()
                if key not in TEXTS
            }
            source = str(entry.get("source", ""))
            if source and "formula" in entry:
                source += f"; BARN metric: {entry['formula']}"
            for robot in entry["robots"]:
                figures_by_setting[name, PublishedSetting(map_name, robot)] = Figures(
                    system.name, system.global_planner, stats, source
                )
    return figures_by_setting


def setting_of(group: pd.DataFrame) -> DrivenSetting | None:
    """Return the setting whose published figures can be compared with these records; None if no figures can.

    Only the complete method is compared, with any weights, no filter, no crowd and no changed key, on all worlds of
    the map; on BARN, on all of `lab100` or `official50`. Map and robot are identified by their values, since a user's
    own option may have the name of a shipped one. Records without a launch record are identified by names alone.
    """
    columns = [key for key in (*_AS_PUBLISHED, "scale", "changes", "map", "subset", "robot") if key in group]
    values = {key: str(group[key].iloc[0]) for key in columns if group[key].notna().iloc[0]}
    # Only the complete method counts, without changed keys.
    options = all(values.get(key, "") in ("", usual) for key, usual in _AS_PUBLISHED.items())
    is_complete = options and not (values.get("scale") or values.get("changes"))
    # Only whole maps have published figures; BARN has two subsets that count as such.
    map_name, subset = _common_value(group, "map_like", values.get("map", "")), values.get("subset", "")
    if map_name == "barn":
        map_name = _BARN_PLACES.get(subset, "")
    elif subset:
        map_name = ""
    all_worlds = group["world"].nunique() >= planned(group, PLANNED_WORLDS)
    if not (is_complete and map_name and all_worlds):
        return None
    robot = values.get("robot", "")
    robots = tuple(_common_value(group, "robot_like", robot).split())
    return DrivenSetting(map_name, robots, robot, _common_value(group, "robot_difference", ""))


def notes(rows: Sequence[Row]) -> list[str]:
    """Return the notes for a table with published figures, and for a table that could have some."""
    maps = {row.published_map for row in rows if row.published_map}
    lines = []
    if maps:
        simulators = " and ".join(sorted({PUBLISHED_IN.get(name, "ROS Stage") for name in maps}))
        own_simulators = " and ".join(sorted({_simulator(row.sim) for row in rows if not row.published_map}))
        lines.append(
            f"Published figures are from {simulators}; all others from this project's {own_simulators}."
        )
    lines += dict.fromkeys(
        f"{row.label}: published figures are left out, because {row.unpublished}."
        for row in rows
        if row.unpublished
    )
    if "barn" in maps:
        lines.append(
            f"The paper does not list its hundred worlds; those here are {BARN_SUBSET}, from its lab's test script."
        )
    return lines


def _simulator(sim: str) -> str:
    """Return a simulator in words, with its option; the first simulator for records that do not name it."""
    words = _SIMULATORS.get(sim, "2D simulator")
    return f"{words} (sim={sim})" if sim else words


def _common_value(group: pd.DataFrame, column: str, otherwise: str) -> str:
    """Return the value that all records have in a column that comes from launch records; empty if they differ."""
    if column not in group:
        return otherwise
    values = group[column].fillna(otherwise).unique()
    return str(values[0]) if len(values) == 1 else ""
