"""Published figures of the named systems, and the records with which they can be compared."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from runners.config.systems import System
from runners.records.planned import WORLDS, planned

if TYPE_CHECKING:
    import pandas as pd

PUBLISHED_IN = {"barn": "Gazebo", "barn_official50": "Gazebo"}  # the paper ran its other maps in ROS Stage
BARN_SUBSET = "lab100"  # the worlds of the paper's BARN figures, as far as is known
_BARN_PLACES = {BARN_SUBSET: "barn", "official50": "barn_official50"}  # what conf/system/ calls these subsets
_AS_PUBLISHED = {"ablation": "none", "filter": "none", "crowd": "none", "people": "truth"}
TEXTS = ("robots", "source", "formula")  # of published figures, besides metrics


class PublishedSetting(NamedTuple):
    """The map and the robot of a measurement."""

    map: str
    robot: str


class Figures(NamedTuple):
    """Published figures. label: without our system's settings in brackets.

    stats: (mean, standard deviation) by metric; a deviation that was not published is NaN. source: the log that they
    are from, with the formula of its BARN metric; empty for those of the paper.
    """

    label: str
    global_planner: bool
    stats: dict[str, tuple[float, float]]
    source: str = ""


def figures(systems: Mapping[str, System]) -> dict[tuple[str, PublishedSetting], Figures]:
    """Published figures by the name of the system in `conf/system/` and by setting."""
    return {
        (name, PublishedSetting(map_name, robot)): Figures(
            system.name, system.global_planner, _stats(given), _source(given)
        )
        for name, system in systems.items()
        for map_name, given in (system.published or {}).items()
        for robot in given["robots"]
    }


def setting_of(group: pd.DataFrame) -> PublishedSetting | None:
    """The setting whose published figures can be compared with these records; None if no figures can.

    Only the complete method is compared, with any weights, no filter, no crowd and no changed key, on all worlds of the
    map; on BARN on all of `lab100` or `official50`.
    """
    known = [key for key in (*_AS_PUBLISHED, "scale", "changes", "map", "subset", "robot") if key in group]
    first = {key: str(group[key].iloc[0]) for key in known if group[key].notna().iloc[0]}
    options = all(first.get(key, "") in ("", usual) for key, usual in _AS_PUBLISHED.items())
    whole = options and not (first.get("scale") or first.get("changes"))
    place, subset = first.get("map", ""), first.get("subset", "")
    if place == "barn":
        place = _BARN_PLACES.get(subset, "")
    elif subset:
        place = ""
    all_worlds = group["world"].nunique() >= planned(group, WORLDS)
    return PublishedSetting(place, first.get("robot", "")) if whole and place and all_worlds else None


def notes(maps: set[str]) -> list[str]:
    """Notes for a table with published figures of these maps."""
    lines = []
    if maps:
        others = " and ".join(sorted({PUBLISHED_IN.get(name, "ROS Stage") for name in maps}))
        lines.append(f"Ours ran in this project's 2D simulator, the published ones in {others}.")
    if "barn" in maps:
        lines.append(
            f"The paper does not list its hundred worlds; ours are {BARN_SUBSET}, those of its lab's test script."
        )
    return lines


def _stats(given: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """(mean, std) by metric, from [mean, std], or from [mean] if no deviation was published."""
    return {
        key: (float(values[0]), float(values[1]) if len(values) > 1 else float("nan"))
        for key, values in given.items()
        if key not in TEXTS
    }


def _source(given: Mapping[str, Any]) -> str:
    """What a note says of the figures: their log, and the formula of its metric."""
    if "source" not in given:
        return ""
    return (
        f"{given['source']}; BARN metric: {given['formula']}" if "formula" in given else str(given["source"])
    )
