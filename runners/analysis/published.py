"""Published figures of the named pairs, and what they may stand beside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from runners.config.systems import System

if TYPE_CHECKING:
    import pandas as pd

PUBLISHED_IN = {"barn": "Gazebo"}  # the paper's other maps ran in ROS Stage


class PublishedSetting(NamedTuple):
    """Where a system was measured."""

    map: str
    robot: str


class Figures(NamedTuple):
    """stats: (mean, standard deviation) by metric, the deviation NaN where none was published."""

    label: str
    global_planner: bool
    stats: dict[str, tuple[float, float]]


def figures(systems: Mapping[str, System]) -> dict[tuple[str, PublishedSetting], Figures]:
    """Published figures by the system's name in `conf/system/` and by place."""
    return {
        (name, PublishedSetting(place, given["robot"])): Figures(
            system.label, system.global_planner, _stats(given)
        )
        for name, system in systems.items()
        for place, given in (system.published or {}).items()
    }


def setting_of(group: pd.DataFrame) -> PublishedSetting | None:
    """Where published figures for these records would be found, were there any.

    Only the whole policy compares, whoever trained it, with nothing changed, and on BARN only the hundred hard worlds.
    """
    known = [key for key in ("ablation", "scale", "changes", "map", "subset", "robot") if key in group]
    first = {key: str(group[key].iloc[0]) for key in known}
    whole = first.get("ablation", "none") == "none" and not (first.get("scale") or first.get("changes"))
    same_worlds = first.get("map") != "barn" or first.get("subset") == "hard100"
    return PublishedSetting(first.get("map", ""), first.get("robot", "")) if whole and same_worlds else None


def notes(maps: set[str]) -> list[str]:
    """What must be said where published figures of these maps are shown."""
    lines = []
    if maps:
        others = " and ".join(sorted({PUBLISHED_IN.get(name, "ROS Stage") for name in maps}))
        lines.append(f"Ours ran in this project's 2D simulator, the published ones in {others}.")
    if "barn" in maps:
        lines.append("The paper does not list its hundred worlds; ours are hard100, worlds 200\u2013299.")
    return lines


def _stats(given: Mapping[str, Sequence[float]]) -> dict[str, tuple[float, float]]:
    """[mean, std], or [mean] where no deviation was published."""
    return {
        key: (float(values[0]), float(values[1]) if len(values) > 1 else float("nan"))
        for key, values in given.items()
        if key != "robot"
    }
