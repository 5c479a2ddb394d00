"""Robots, map sets, simulators and learned parameters by name, read without Hydra."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from lme.drivetrain import Controller, Drivetrain, Response
from lme.errors import InputError, nearest
from lme.policies.lme.parameter_file import read_parameters
from lme.policies.lme.score import CRITERIA
from lme.resources import overlaid, resource_dir
from lme.robots import Cloud, Contact, Footprint, Lidar, Robot
from lme.yaml_entry import Entry, read_yaml

if TYPE_CHECKING:
    from lme.worlds.world import MapSet

_Part = TypeVar("_Part")
_PARTS = {
    part.__name__: part for part in (Cloud, Contact, Controller, Drivetrain, Footprint, Lidar, Response)
}

_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "int": (lambda given: type(given) is int, "a whole number"),
    "bool": (lambda given: isinstance(given, bool), "true or false"),
    "list[int]": (lambda given: _is_list_of(given, (int,)), "a list of whole numbers"),
    "list[float]": (lambda given: _is_list_of(given, (int, float)), "a list of numbers"),
}


def load_robot(robot: str | Path) -> Robot:
    """The robot of `conf/robot/NAME.yaml` by its name, or of your own YAML file by its path.

    Raises InputError if there is no such robot, or if a value in the file is missing or wrong.
    """
    path = _find("robot", robot)
    return _build(Robot, str(path), _with_base(path))


def load_map_set(name: str, settings: Mapping[str, Any] | None = None, robot: Robot | None = None) -> MapSet:
    """The map set of `conf/map/NAME.yaml`, with other values for some of its keys.

    A `radius` of null becomes that of the robot. Raises InputError for an unknown name or key, or a wrong value.
    """
    target, values, place = _described("map", name, settings)
    if "radius" in values and values["radius"] is None:
        if robot is None:
            raise InputError(
                "map.radius is null: must be given if robots are drawn at random, at least that of the largest"
            )
        values["radius"] = robot.hull.r_max
    made: MapSet = target(_build(target.Config, place, values))
    return made


def load_simulator(name: str, settings: Mapping[str, Any] | None = None) -> tuple[Any, Any]:
    """The class of the simulator of `conf/sim/NAME.yaml` and its Config, with other values for some keys.

    Raises InputError for an unknown name or key, or a wrong value.
    """
    target, values, place = _described("sim", name, settings)
    return target, _build(target.Config, place, values)


def load_parameters(weights: str | Path = "published") -> dict[str, float]:
    """The eight parameters of `conf/weight_set/NAME.yaml` by its name, or of a weight file by its path.

    Six weights, d1 [m] and d2. Raises InputError if there is no such file, or if a parameter in it is
    missing or wrong.
    """
    return read_parameters(_find("weight_set", weights), CRITERIA)


def _find(group: str, given: str | Path) -> Path:
    shipped = {path.stem: path for path in sorted((resource_dir("conf") / group).glob("*.yaml"))}
    if given in shipped:
        return shipped[str(given)]
    if Path(given).is_file():
        return Path(given)
    known = [name for name in shipped if not name.startswith("_")]
    what, names = group.replace("_", " "), ", ".join(known)
    hint = nearest(str(given), known)
    raise InputError(f"{what} is {str(given)!r}: {hint}must be one of {names}, or the path of a YAML file")


def _described(group: str, name: str, settings: Mapping[str, Any] | None) -> tuple[Any, dict[str, Any], str]:
    """The class that an option's `_target_` names, the values of its keys, and the place that messages name."""
    path = _find(group, name)
    values = _with_base(path, group)
    assert isinstance(values, dict)
    module, _, target = values.pop("_target_").rpartition(".")
    place = f"{group} {name}" if settings else str(path)
    return getattr(importlib.import_module(module), target), {**values, **(settings or {})}, place


def _with_base(path: Path, group: str = "robot") -> object:
    """An option's mapping, over those of the options in its `defaults`, as Hydra composes `[jackal, _self_]`."""
    own = read_yaml(path)
    if not isinstance(own, dict) or "defaults" not in own:
        return own
    merged: dict[str, Any] = {}
    bases = [_with_base(_find(group, name), group) for name in own.pop("defaults") if name != "_self_"]
    for layer in (*bases, own):
        merged = overlaid(merged, layer) if isinstance(layer, dict) else merged
    return merged


def _build(part: type[_Part], place: str, value: object) -> _Part:
    """A dataclass from a mapping with a key for each of its fields."""
    known = fields(part)  # type: ignore[arg-type]
    required = [field.name for field in known if field.default is MISSING]
    optional = [field.name for field in known if field.default is not MISSING]
    entry = Entry(place, value, required, optional)
    return part(**{field.name: _value(entry, field) for field in known})


def _value(entry: Entry, field: Field[Any]) -> Any:
    key, default = field.name, field.default
    given = entry.value(key, default)
    if given is None and str(field.type).endswith("| None"):
        return None
    part = _PARTS.get(str(field.type).removesuffix(" | None"))
    if part is not None:
        return _build(part, f"{entry.place}, {key}", given)
    kind = str(field.type).removesuffix(" | None")
    if kind == "str":
        return str(given)
    if kind not in _KINDS:
        return entry.number(key, given)
    fits, right = _KINDS[kind]
    if not fits(given):
        raise entry.mistake(key, right)
    return given


def _is_list_of(given: object, types: tuple[type, ...]) -> bool:
    """Whether `given` is a list of values of exactly these types."""
    return isinstance(given, list) and all(type(item) in types for item in given)
