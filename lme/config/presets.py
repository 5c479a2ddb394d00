"""Robots, map sets, simulators and learned parameters by name."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import MISSING, asdict, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_type_hints

from lme.config import composer
from lme.errors import InputError, building, nearest
from lme.guides.lme.weight_files import (
    PUBLISHED,
    find_weights,
    learned_parameters,
    set_names,
    shipped_weights,
)
from lme.inputs.guarded_file import expanded, read_yaml
from lme.inputs.resources import overlaid, resource_dir
from lme.inputs.yaml_entry import Entry
from lme.robots import Robot

if TYPE_CHECKING:
    from lme.worlds.world import MapSet

_Part = TypeVar("_Part")
_KINDS: dict[Any, tuple[Callable[[Any], bool], str]] = {
    int: (lambda given: type(given) is int, "a whole number"),
    bool: (lambda given: isinstance(given, bool), "true or false"),
    list[int]: (lambda given: _is_list_of(given, (int,)), "a list of whole numbers"),
    list[float]: (lambda given: _is_list_of(given, (int, float)), "a list of numbers"),
    list[str]: (lambda given: _is_list_of(given, (str,)), "a list of texts"),
    dict[str, float]: (lambda given: _is_mapping_to(given, (int, float)), "a mapping of names to numbers"),
    dict[str, str]: (lambda given: _is_mapping_to(given, (str,)), "a mapping of names to text"),
}


def load_robot(robot: str | Path) -> Robot:
    """Return the robot of `conf/robot/NAME.yaml` by its name, or of your own YAML file by its path.

    Raises InputError if there is no such robot, or if a value in the file is missing or wrong.
    """
    path = find_option("robot", robot)
    made: Robot = _build(Robot, str(path), "robot", composer.compose(path, "robot").values)
    if made.radius_note and path.parent != resource_dir("conf") / "robot":
        warnings.warn(f"{path}: {made.radius_note}", stacklevel=2)
    return made


def load_map_set(name: str, settings: Mapping[str, Any] | None = None, robot: Robot | None = None) -> MapSet:
    """Return the map set of `conf/map/NAME.yaml`, with other values for some of its keys.

    A `radius` and a `v_max` of null become those of the robot; without a robot v_max is 0.5 m/s. Raises InputError for
    an unknown name or key, a wrong value, or a key that the map set would not use.
    """
    from lme.worlds.barn.map_set import check_given
    from lme.worlds.rules import with_robot

    config = {} if robot is None else {"robot": asdict(robot)}
    values, place = option("map", name, settings, config)
    if robot is not None:
        values = with_robot(values, robot)
    elif "radius" in values and values["radius"] is None:
        raise InputError(
            "map.radius is null: must be given if robots are drawn at random, at least that of the largest"
        )
    check_given(settings or {}, values)
    target, config = configured(values, place, "map")
    with building("map"):
        made: MapSet = target(config)
    return made


def load_simulator(name: str, settings: Mapping[str, Any] | None = None) -> tuple[Any, Any]:
    """Return the class of the simulator of `conf/sim/NAME.yaml` and its Config, with other values for some keys.

    Raises InputError for an unknown name or key, or a wrong value.
    """
    return configured(*option("sim", name, settings), "sim")


def load_settings(option: str, /, **changes: Any) -> Any:
    """Return the Config of an option of `conf/`, with other values for some of its keys::

        planner = lme.Dwa(lme.load_settings("planner/dwa", margin=0.1), robot)

    option: GROUP/NAME. changes: a mapping changes only the keys that it names of a part, such as
    `candidates={"number": 500}`. Raises InputError for an unknown option or key, and for a wrong value.
    """
    return _changed(deepcopy(_shipped_settings(option)), changes, option.partition("/")[0])


@cache
def _shipped_settings(option_name: str) -> Any:
    group, _, name = option_name.rpartition("/")
    if not group:
        raise InputError(
            f"option is {option_name!r}: must be GROUP/NAME of a file in conf/, such as planner/dwa"
        )
    values, place = option(group, name, config={"weights": PUBLISHED, "ablation": {}, "seed": 0})
    return configured(values, place, group)[1]


def _changed(config: Any, changes: Mapping[str, Any], key: str) -> Any:
    """Return the dataclass of a config key with other values for some fields, and for some fields of its parts."""
    known = [each.name for each in fields(config)]
    values = {}
    for name, value in changes.items():
        if name not in known:
            raise InputError(
                f"{key}.{name}: no such key; {nearest(name, known)}{key} holds: {', '.join(known)}"
            )
        part = getattr(config, name)
        is_part = is_dataclass(part) and isinstance(value, Mapping)
        values[name] = _changed(part, value, f"{key}.{name}") if is_part else value
    with building(key):
        return replace(config, **values)


def load_parameters(weights: str | Path = "published") -> dict[str, float]:
    """Return the parameters of a weight set: a weight for each criterion, d1 [m] and d2.

    weights: a name in `conf/weight_set/` or `outputs/weights/`, the directory of a training run, or the path of a file.
    The criteria are LME+'s if the file has just these, else the paper's six. Raises
    InputError if there is no such file, or if a parameter in it is missing or wrong.
    """
    content = read_yaml(find_weights(str(weights)))
    given = content.get("parameters") if isinstance(content, dict) else None
    names = set(given) if isinstance(given, dict) else set()
    own = next((own for own in shipped_weights() if names == set(set_names(own))), PUBLISHED)
    return learned_parameters(str(weights), own)


def option(
    group: str,
    name: str | Path,
    settings: Mapping[str, Any] | None = None,
    config: Mapping[str, Any] | None = None,
    folders: Sequence[Path] = composer.SHIPPED,
) -> tuple[dict[str, Any], str]:
    """Return the values of the keys of `conf/GROUP/NAME.yaml`, some replaced by `settings`, and a name for messages.

    config: other keys of the whole config, for values that follow them. folders: config folders that may hold the
    option. Raises InputError.
    """
    path = find_option(group, name, folders)
    place = f"{group} {name}" if settings else str(path)
    values = overlaid(composer.compose(path, group).values, settings or {})
    return composer.resolved(group, values, config or {}, place), place


def configured(values: Mapping[str, Any], place: str, key: str) -> tuple[Any, Any]:
    """Return the class that `_target_` names, and its Config with the other values.

    place, key: the source of the values and their key in the whole config, for messages. Raises InputError for an
    unknown key or a wrong value.
    """
    module, _, target = str(values["_target_"]).rpartition(".")
    made = getattr(importlib.import_module(module), target)
    return made, _build(
        made.Config, place, key, {name: value for name, value in values.items() if name != "_target_"}
    )


def find_option(group: str, given: str | Path, folders: Sequence[Path] = composer.SHIPPED) -> Path:
    """Return the file of an option, given its path, or its name in one of the config folders.

    Raises InputError if there is none.
    """
    files = [path for folder in folders for path in sorted((folder / group).glob("*.yaml"))]
    options = {path.stem: path for path in reversed(files)}  # of two with one name, the first
    if given in options:
        return options[str(given)]
    own = expanded(given)
    if own.is_file():
        return own
    known = [name for name in sorted(options) if not name.startswith("_")]
    what, names = group.replace("_", " "), ", ".join(known)
    hint = nearest(str(given), known)
    raise InputError(f"{what} is {str(given)!r}: {hint}must be one of {names}, or the path of a YAML file")


def _build(part: type[_Part], place: str, key: str, value: object) -> _Part:
    """Build a dataclass from a mapping with a key for each field without a default, and perhaps for the others.

    place, key: those of the mapping, for messages.
    """
    known = fields(part)  # type: ignore[arg-type]
    required = [each.name for each in known if each.default is each.default_factory is MISSING]
    optional = [each.name for each in known if each.name not in required]
    entry, kinds = Entry(place, value, required, optional), get_type_hints(part)
    values = {name: _value(entry, name, kinds[name], f"{key}.{name}") for name in entry.keys}
    with building(key):
        return part(**values)


def _value(entry: Entry, key: str, kind: Any, config_key: str) -> Any:
    given, kinds = entry.value(key), get_args(kind)
    if NoneType in kinds:
        if given is None:
            return None
        kind = next(each for each in kinds if each is not NoneType)
    if isinstance(kind, type) and is_dataclass(kind):
        return _build(kind, f"{entry.place}, {key}", config_key, given)
    if kind is str:
        return str(given)
    if kind is float:
        return entry.number(key)
    if kind not in _KINDS:
        return given
    fits, right = _KINDS[kind]
    if not fits(given):
        raise entry.mistake(key, right)
    return given


def _is_list_of(given: object, types: tuple[type, ...]) -> bool:
    """Return whether `given` is a list of values of exactly these types."""
    return isinstance(given, list) and all(type(item) in types for item in given)


def _is_mapping_to(given: object, types: tuple[type, ...]) -> bool:
    return isinstance(given, Mapping) and all(type(item) in types for item in given.values())
