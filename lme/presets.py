"""Robots and learned parameters by name, read without Hydra."""

from __future__ import annotations

from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Any, TypeVar

from lme.drivetrain import Controller, Drivetrain, Response
from lme.errors import InputError, nearest
from lme.policy.parameter_file import read_parameters
from lme.policy.score import CRITERIA
from lme.resources import overlaid, resource_dir
from lme.robots import Cloud, Contact, Footprint, Lidar, Robot
from lme.yaml_entry import Entry, read_yaml

_Part = TypeVar("_Part")
_PARTS = {
    part.__name__: part for part in (Cloud, Contact, Controller, Drivetrain, Footprint, Lidar, Response)
}


def load_robot(robot: str | Path) -> Robot:
    """The robot of `conf/robot/NAME.yaml` by its name, or of a YAML file of your own by its path.

    Raises InputError where there is no such robot, and where a value in the file is missing or not right.
    """
    path = _find("robot", robot)
    return _filled(Robot, str(path), _with_base(path))


def load_parameters(weights: str | Path = "published") -> dict[str, float]:
    """The eight parameters of `conf/weight_set/NAME.yaml` by its name, or of a weight file by its path.

    Six weights, d1 [m] and d2. Raises InputError where there is no such file, and where a parameter in it is
    missing or not right.
    """
    return read_parameters(_find("weight_set", weights), CRITERIA)


def _find(group: str, given: str | Path) -> Path:
    shipped = {path.stem: path for path in sorted((resource_dir("conf") / group).glob("*.yaml"))}
    if given in shipped:
        return shipped[str(given)]
    if Path(given).is_file():
        return Path(given)
    what, names = group.replace("_", " "), ", ".join(shipped)
    hint = nearest(str(given), shipped)
    raise InputError(f"{what} is {str(given)!r}: {hint}must be one of {names}, or the path of a YAML file")


def _with_base(path: Path) -> object:
    """A robot's mapping over that of the robots in its `defaults`, as Hydra composes `[jackal, _self_]`."""
    own = read_yaml(path)
    if not isinstance(own, dict) or "defaults" not in own:
        return own
    merged: dict[str, Any] = {}
    bases = [_with_base(_find("robot", name)) for name in own.pop("defaults") if name != "_self_"]
    for layer in (*bases, own):
        merged = overlaid(merged, layer) if isinstance(layer, dict) else merged
    return merged


def _filled(part: type[_Part], place: str, value: object) -> _Part:
    """A dataclass from a mapping with a key for each of its fields."""
    known = fields(part)  # type: ignore[arg-type]
    required = [field.name for field in known if field.default is MISSING]
    optional = [field.name for field in known if field.default is not MISSING]
    entry = Entry(place, value, required, optional)
    return part(**{field.name: _value(entry, field) for field in known})


def _value(entry: Entry, field: Field[Any]) -> Any:
    key, default = field.name, field.default
    given = entry.value(key, default)
    if given is None and default is None:
        return None
    part = _PARTS.get(str(field.type).removesuffix(" | None"))
    if part is not None:
        return _filled(part, f"{entry.place}, {key}", given)
    if field.type == "str":
        return str(given)
    whole = field.type in ("int", "int | None")
    if whole and type(given) is not int:
        raise entry.mistake(key, "a whole number")
    return given if whole else entry.number(key, given)
