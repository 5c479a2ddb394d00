"""A config compared with the files in `conf/`: keys that were changed, and options that it equals by its values."""

from __future__ import annotations

import os.path
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from lme.config.composer import SHIPPED
from lme.errors import InputError
from lme.inputs.resources import overlaid
from lme.robots import Robot
from runners.config import systems
from runners.config.catalogue import Catalogue
from runners.config.instantiate import fill_dataclass
from runners.config.quoting import value_text
from runners.config.schema import COMMANDS

GROUPS = (
    "robot",
    "map",
    "guide",
    "planner",
    "filter",
    "ablation",
    "sim",
    "crowd",
)  # the groups that an episode depends on
HAVE_COLUMNS = ("map.subset", "map.worlds")  # records hold these in columns of their own
BARE_KEYS = ("feedback", "costmap_clocks")  # without a dot; the records have `people` anyway
_WHICH_WORLDS = ("subset", "worlds", "count")
HELD_OUT = "held_out."  # the maps of `lme train` that are held out
TRAINING, TRAINING_ROBOTS = "training.", "training_robots."  # the maps of its families, and their robots
_LIMITS = ("v_max", "omega_max", "alpha_v", "alpha_omega")
# Keys of a map that choose its worlds or its rule for the optimal time, but do not change the worlds.
_BESIDE = ("name", "worlds", "subset", "count", "fresh_seed", "speed")


def changed_keys(config: DictConfig, choices: Mapping[str, str], catalogue: Catalogue) -> dict[str, Any]:
    """Return the dotted keys and values of a composed config that differ from the files of its `choices`.

    A value that a file interpolates, such as the guide's parameters, counts as changed only if the interpolation is
    replaced: its source is recorded anyway. A key that the file of a system or an ablation sets does not count as
    changed, whichever group it belongs to. The key of a held-out map is "held_out.NAME.KEY", that of a family
    "training.NAME.KEY".
    """
    changes = {}
    beside = systems.system_settings(choices.get("system", ""), catalogue)
    beside = overlaid(beside, systems.ablation_settings(choices.get(systems.ABLATION, ""), catalogue))
    for node, names in _chosen(config, choices):
        group_config: Any = OmegaConf.select(config, node)
        if not isinstance(group_config, DictConfig):
            raise InputError(f"{node} is {group_config!r}: must be a mapping, such as a file in conf/ has")
        if not group_config:  # such as crowd=none
            continue
        written = _written(names, {**_of_family(node, config, catalogue), **beside.get(node, {})}, catalogue)
        resolved = dict(flatten(_plain(group_config, resolve=True), f"{node}."))
        for key, value in flatten(_plain(group_config, resolve=False)):
            dotted = f"{node}.{key}"
            # Records show in another way which worlds were driven, and how many.
            is_shown = dotted in HAVE_COLUMNS or (node.startswith(TRAINING) and key in _WHICH_WORLDS)
            if not is_shown and not (key in written and _equal(written[key], value)):
                changes[dotted] = resolved.get(dotted, value)
    # Keys outside of these nodes: whom the system sees, from where commands ramp, their cap, and the clocks and range
    # of costmaps.
    schema: Any = OmegaConf.get_type(config)
    defaults = {
        schema_field.name: schema_field.default
        for schema_field in fields(schema)
        if schema_field.name in ("people", "feedback")
    }
    usual = {key: str(beside.get(key, default)) for key, default in defaults.items()}
    changes |= {key: str(config[key]) for key, value in usual.items() if config[key] != value}
    sim = f"sim/{choices.get('sim', '')}"
    profile = catalogue.values(sim) if catalogue.has(sim) else {}
    caps = {**profile.get("cap", {}), **beside.get("cap", {})}
    changes |= {f"cap.{key}": value for key, value in config.cap.items() if value != caps.get(key)}
    clocks = profile.get("costmap_clocks", False)
    if OmegaConf.select(config, "costmap_clocks", default=clocks) != clocks:
        changes["costmap_clocks"] = config.costmap_clocks
    if OmegaConf.select(config, "costmap_range") is not None and "costmap" in config.guide:
        costmap = config.guide.costmap
        changes |= {f"guide.costmap.{key}": costmap[key] for key in ("obstacle_range", "raytrace_range")}
    return changes


def _of_family(node: str, config: DictConfig, catalogue: Catalogue) -> dict[str, Any]:
    """Return the values that the command's own config sets for a family of training worlds."""
    if not node.startswith(TRAINING):
        return {}
    command = next((name for name, kind in COMMANDS.items() if OmegaConf.get_type(config) is kind), None)
    families = catalogue.values(command).get("training", {}) if command else {}
    return cast(dict[str, Any], families.get(node.removeprefix(TRAINING)) or {})


def is_config_key(column: str) -> bool:
    """Return whether a column of records is for a key of the config that some run has changed."""
    return "." in column or column in BARE_KEYS


def describe_changes(changes: Mapping[str, Any]) -> str:
    """Return text such as "robot.v_max=1, sim.latency=0.1"; empty if nothing is changed."""
    # Keys are separated by ", ", which no value contains.
    return ", ".join(f"{key}={value_text(value).replace(', ', ',')}" for key, value in changes.items())


def _chosen(config: DictConfig, choices: Mapping[str, str]) -> Iterator[tuple[str, list[str]]]:
    """Yield each node of the config that an episode depends on, with the YAML files chosen for it, if any."""
    for group in GROUPS:
        if group in config:
            yield (
                group,
                [f"{group}/{choices[group]}"] if group in choices and group != systems.ABLATION else [],
            )
    for choice, option in choices.items():
        group, _, node = choice.partition("@")
        named = node.startswith((HELD_OUT, TRAINING, TRAINING_ROBOTS))
        if named and OmegaConf.select(config, node) is not None:
            yield node, [f"{group}/{option}"]


def _written(names: Sequence[str], ablated: Mapping[str, Any], catalogue: Catalogue) -> dict[str, Any]:
    """Return the values in the files of options by dotted key, with the defaults that a robot's file leaves out.

    ablated: values with which an ablation, or the config of the command, replaces them.
    """
    defaults = [OmegaConf.structured(Robot)] if any(name.startswith("robot/") for name in names) else []
    merged: Any = OmegaConf.merge(*defaults, *(catalogue.values(name) for name in names), ablated)
    return dict(flatten(_plain(merged, resolve=False)))


def _plain(node: Any, *, resolve: bool) -> dict[str, Any]:
    plain: Any = OmegaConf.to_container(node, resolve=resolve) if OmegaConf.is_config(node) else node
    return cast(dict[str, Any], plain)


def _equal(written: Any, value: Any) -> bool:
    """Return whether a value is as written. Plain YAML reads a float without a point, such as 1e0, as text."""
    try:
        return bool(written == value or (isinstance(value, float) and float(written) == value))
    except (TypeError, ValueError):
        return False


def flatten(config: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield ("a.b", value) for every leaf of a nested mapping."""
    for key, value in config.items():
        if isinstance(value, Mapping):
            yield from flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def dotted_keys(config: Mapping[str, Any], prefix: str = "") -> set[str]:
    """Return "a" and "a.b" for every mapping and every leaf of a nested mapping."""
    keys = set()
    for name, child in config.items():
        keys.add(f"{prefix}{name}")
        if isinstance(child, dict):
            keys |= dotted_keys(child, f"{prefix}{name}.")
    return keys


def robots_like(
    robot: Mapping[str, Any], folders: tuple[Path, ...], settings: Mapping[str, Any] | None = None
) -> list[str]:
    """Return the robots of the config folders with these values, except for limits that may be higher.

    settings: keys of the robot that its system sets, which do not make it another robot.
    """
    ours, set_keys = _values(robot), dict(flatten(settings or {}))

    def is_like(values: Mapping[str, Any]) -> bool:
        return not any(_differing(ours, {**values, **set_keys}, limits=True))

    # The numbers in their files tell most robots apart: to fill in the defaults of all of them takes longer.
    written = _robots(folders)
    numbers = {
        name: {key: value for key, value in flatten(values) if _is_number(value)}
        for name, values in written.items()
    }
    candidates = [name for name in written if is_like({**ours, **numbers[name]})]
    return [name for name in candidates if (values := _values(written[name])) and is_like(values)]


def robot_difference(robot: Mapping[str, Any], settings: Mapping[str, Any] | None = None) -> str:
    """Return the first difference of a robot from the shipped one of its name; empty if there is none.

    settings: keys of the robot that its system sets, which do not count. An example is "robot.v_max is 1, and 0.5 in
    the shipped stage".
    """
    ours = _values(robot)
    name = ours.get("name")
    written = next((values for values in _robots(SHIPPED).values() if values.get("name") == name), None)
    shipped = None if written is None else {**_values(written), **dict(flatten(settings or {}))}
    key = None if shipped is None else next(_differing(ours, shipped, limits=False), None)
    if shipped is None or key is None:
        return ""
    return f"robot.{key} is {_or_null(ours.get(key))}, and {_or_null(shipped.get(key))} in the shipped {name}"


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
        {key: value for key, value in flatten(config) if key not in _BESIDE}
        for config in (node, catalogue.values(f"map/{name}"))
    )
    same = all(_same(ours.get(key), theirs.get(key)) for key in ours.keys() | theirs.keys())
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
    """Return the values in the file of every robot by option; one that cannot be read is left out."""
    catalogue, robots = Catalogue(folders), {}
    for name in catalogue.options("robot"):
        try:
            robots[name] = dict(catalogue.values(f"robot/{name}"))
        except (InputError, OSError, UnicodeDecodeError, AttributeError, TypeError, RecursionError):
            continue
    return robots


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
        if key != "name" and not (lower or _same(own, usual)):
            yield key


def _below(limit: Any, other: Any) -> bool:
    """Return whether a limit is lower than another; null stands for backing up as fast as driving ahead."""
    if other is not None and limit is None:
        return True
    return _is_number(limit) and _is_number(other) and float(limit) < float(other)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _same(value: Any, other: Any) -> bool:
    """Return whether two values are equal. Plain YAML reads a float without a point, such as 1e0, as text."""
    if value == other:
        return True
    try:
        return float(value) == float(other)
    except (TypeError, ValueError):
        return False


def _or_null(value: Any) -> str:
    return "null" if value is None else str(value)
