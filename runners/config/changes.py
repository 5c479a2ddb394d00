"""Changed keys: keys with other values than in the files of the chosen options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError
from lme.robots import Robot
from runners.config import ablations
from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten
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
_WHICH_WORLDS = ("subset", "worlds", "count")
HELD_OUT = "held_out."  # the maps of `lme train` that are held out
TRAINING, TRAINING_ROBOTS = "training.", "training_robots."  # the maps of its families, and their robots


def changed_keys(config: DictConfig, choices: Mapping[str, str], catalogue: Catalogue) -> dict[str, Any]:
    """Return the dotted keys and values of a composed config that differ from the files of its `choices`.

    A value that a file interpolates, such as the guide's parameters, counts as changed only if the interpolation is
    replaced: its source is recorded anyway. A key that an ablation's file sets does not count as changed, whichever
    group it belongs to. The key of a held-out map is "held_out.NAME.KEY", that of a family "training.NAME.KEY".
    """
    changes = {}
    ablated = ablations.settings(choices.get(ablations.GROUP, ""), catalogue)
    for node, names in _chosen(config, choices):
        given: Any = OmegaConf.select(config, node)
        if not isinstance(given, DictConfig):
            raise InputError(f"{node} is {given!r}: must be a mapping, such as a file in conf/ has")
        written = _written(names, {**_of_family(node, config, catalogue), **ablated.get(node, {})}, catalogue)
        resolved = dict(flatten(_plain(given, resolve=True), f"{node}."))
        for key, value in flatten(_plain(given, resolve=False)):
            dotted = f"{node}.{key}"
            if not _is_shown(node, key) and not (key in written and _equal(written[key], value)):
                changes[dotted] = resolved.get(dotted, value)
    return changes | _changed_keys(config) | _changed_costmap_range(config)


def _of_family(node: str, config: DictConfig, catalogue: Catalogue) -> dict[str, Any]:
    """Return the values that the command's own config sets for a family of training worlds."""
    if not node.startswith(TRAINING):
        return {}
    command = next((name for name, kind in COMMANDS.items() if OmegaConf.get_type(config) is kind), None)
    families = catalogue.values(command).get("training", {}) if command else {}
    return cast(dict[str, Any], families.get(node.removeprefix(TRAINING)) or {})


def _changed_keys(config: DictConfig) -> dict[str, Any]:
    """Return `people` and `feedback`, if they differ from the command's defaults."""
    schema: Any = OmegaConf.get_type(config)
    defaults = {each.name: each.default for each in fields(schema) if each.name in ("people", "feedback")}
    return {key: str(config[key]) for key, default in defaults.items() if config[key] != default}


def _changed_costmap_range(config: DictConfig) -> dict[str, Any]:
    """Return the ranges of a guide's costmap, if they follow `costmap_range`."""
    if OmegaConf.select(config, "costmap_range") is None or "costmap" not in config.guide:
        return {}
    return {f"guide.costmap.{key}": config.guide.costmap[key] for key in ("obstacle_range", "raytrace_range")}


def _is_shown(node: str, key: str) -> bool:
    """Return whether records show a key in another way, as they do which worlds were driven, and how many."""
    return f"{node}.{key}" in HAVE_COLUMNS or (node.startswith(TRAINING) and key in _WHICH_WORLDS)


def describe_changes(changes: Mapping[str, Any]) -> str:
    """Return text such as "robot.v_max=1, sim.latency=0.1"; empty if nothing is changed."""
    return ", ".join(f"{key}={_shown(value)}" for key, value in changes.items())


def _chosen(config: DictConfig, choices: Mapping[str, str]) -> Iterator[tuple[str, list[str]]]:
    """Yield each node of the config that an episode depends on, with the YAML files chosen for it, if any."""
    for group in GROUPS:
        if group in config:
            yield (
                group,
                [f"{group}/{choices[group]}"] if group in choices and group != ablations.GROUP else [],
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
    found: Any = OmegaConf.to_container(node, resolve=resolve) if OmegaConf.is_config(node) else node
    return cast(dict[str, Any], found)


def _equal(written: Any, value: Any) -> bool:
    """Return whether a value is as written. Plain YAML reads a float without a point, such as 1e0, as text."""
    try:
        return bool(written == value or (isinstance(value, float) and float(written) == value))
    except (TypeError, ValueError):
        return False


def _shown(value: Any) -> str:
    """Return a value as text without ", ", which separates the keys."""
    return str(value).replace(", ", ",")
