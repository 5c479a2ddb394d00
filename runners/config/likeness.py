"""Identify the options that a run's robot and map equal by their values, whatever they are called."""

from __future__ import annotations

import os.path
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from lme.config.composer import SHIPPED
from lme.errors import InputError
from lme.robots import Robot
from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten
from runners.config.instantiate import fill_dataclass

_LIMITS = ("v_max", "omega_max", "alpha_v", "alpha_omega")
# Keys of a map that choose its worlds or its rule for the optimal time, but do not change the worlds.
_BESIDE = ("name", "worlds", "subset", "count", "fresh_seed", "speed")


def robots_like(robot: Mapping[str, Any], folders: tuple[Path, ...]) -> list[str]:
    """Return the robots of the config folders with these values, except for limits that may be higher."""
    ours = _values(robot)
    return [name for name, other in _robots(folders).items() if not any(_differing(ours, other, limits=True))]


def robot_difference(robot: Mapping[str, Any]) -> str:
    """Return the first difference of a robot from the shipped one of its name; empty if there is none.

    An example is "robot.v_max is 1, and 0.5 in the shipped stage".
    """
    ours = _values(robot)
    name = ours.get("name")
    shipped = next((one for one in _robots(SHIPPED).values() if one["name"] == name), None)
    key = None if shipped is None else next(_differing(ours, shipped, limits=False), None)
    if shipped is None or key is None:
        return ""
    return f"robot.{key} is {_shown(ours.get(key))}, and {_shown(shipped.get(key))} in the shipped {name}"


def radius_note(robot: Robot) -> str:
    """Return the note on a small collision radius, unless the robot is a shipped one; empty if none is needed."""
    return (
        f"robot.{robot.radius_note}" if robot.radius_note and not robots_like(asdict(robot), SHIPPED) else ""
    )


def map_like(node: Mapping[str, Any], option: str, name: str) -> str:
    """Return the shipped map set that a map's config equals by its values; empty for any other map.

    This is `option` itself if it ships, else `name` if all values agree.
    """
    catalogue = Catalogue(SHIPPED)
    if catalogue.has(f"map/{option}"):
        return option
    if not catalogue.has(f"map/{name}"):
        return ""
    ours, theirs = (
        {key: value for key, value in flatten(one) if key not in _BESIDE}
        for one in (node, catalogue.values(f"map/{name}"))
    )
    same = all(_equal(ours.get(key), theirs.get(key)) for key in ours.keys() | theirs.keys())
    return name if same else ""


def namesakes(choices: Mapping[str, str], folders: tuple[Path, ...]) -> Iterator[str]:
    """Yield a line of warning for each of a user's own files that can be taken for a shipped option."""
    shipped = Catalogue(SHIPPED)
    for choice, option in choices.items():
        group = choice.partition("@")[0]
        own = [folder / group / f"{option}.yaml" for folder in folders[len(SHIPPED) :]]
        for file in filter(os.path.isfile, own):
            if shipped.has(f"{group}/{option}"):
                yield f"{file}: is not read, because {group}={option} ships with lme: give the file a name of its own"
            elif group == "robot":
                difference = robot_difference(Catalogue(folders).values(f"robot/{option}"))
                if difference:
                    yield f"{file}: {difference}; give the robot a name of its own, which tables show"


@cache
def _robots(folders: tuple[Path, ...]) -> dict[str, dict[str, Any]]:
    """Return the values of every robot by option; one that cannot be read is left out."""
    catalogue, robots = Catalogue(folders), {}
    for name in catalogue.options("robot"):
        try:
            robots[name] = _values(catalogue.values(f"robot/{name}"))
        except (InputError, OSError, UnicodeDecodeError, AttributeError, TypeError, RecursionError):
            continue
    return {name: values for name, values in robots.items() if values}


def _values(robot: Mapping[str, Any]) -> dict[str, Any]:
    """Return all values of a robot by dotted key, defaults included; {} if they are not those of a robot.

    The record of a run may come from somebody else, so interpolations are not resolved.
    """
    if any("${" in str(value) for _, value in flatten(robot)):
        return {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of implausible values: given once, by composing
            return dict(flatten(asdict(fill_dataclass(Robot, dict(robot), "robot"))))
    except InputError:
        return {}


def _differing(ours: Mapping[str, Any], theirs: Mapping[str, Any], limits: bool) -> Iterator[str]:
    """Yield the keys whose values differ. limits: whether a limit of ours may be lower than theirs."""
    for key in dict.fromkeys((*theirs, *ours)):
        own, usual = ours.get(key), theirs.get(key)
        lower = limits and (
            (key in _LIMITS and _below(own, usual)) or (key == "v_min" and _below(usual, own))
        )
        if key != "name" and not (lower or _equal(own, usual)):
            yield key


def _below(one: Any, other: Any) -> bool:
    """Return whether a limit is lower than another; null stands for backing up as fast as driving ahead."""
    if other is not None and one is None:
        return True
    return _is_number(one) and _is_number(other) and float(one) < float(other)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _equal(one: Any, other: Any) -> bool:
    """Return whether two values are equal. Plain YAML reads a float without a point, such as 1e0, as text."""
    if one == other:
        return True
    try:
        return float(one) == float(other)
    except (TypeError, ValueError):
        return False


def _shown(value: Any) -> str:
    return "null" if value is None else str(value)
