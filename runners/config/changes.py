"""Changed keys: those with other values than in the files of the chosen options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from lme.robots import Robot
from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten

GROUPS = ("robot", "map", "guide", "planner", "ablation", "sim")  # the groups that an episode depends on
HAVE_COLUMNS = ("map.subset", "map.worlds")  # records hold these in columns of their own
HELD_OUT = "held_out."  # the maps of `lme train` that are held out
SEVERAL = "+"  # joins the options of a group of which several are chosen


def changed_keys(config: DictConfig, choices: Mapping[str, str], catalogue: Catalogue) -> dict[str, Any]:
    """Dotted keys and values of a composed config that differ from the files of its `choices`.

    A value that a file interpolates, such as the guide's parameters, is changed only if it does not stand there as
    the file writes it: what it follows is recorded. The key of a held-out map is "held_out.NAME.KEY".
    """
    changes = {}
    for node, group, options in _chosen(config, choices):
        given: Any = OmegaConf.select(config, node)
        written = _written([f"{group}/{option}" for option in options], catalogue)
        resolved = dict(flatten(_plain(given, resolve=True), f"{node}."))
        for key, value in flatten(_plain(given, resolve=False)):
            dotted = f"{node}.{key}"
            if dotted not in HAVE_COLUMNS and not (key in written and _equal(written[key], value)):
                changes[dotted] = resolved.get(dotted, value)
    return changes


def in_words(changes: Mapping[str, Any]) -> str:
    """ "robot.v_max=1, sim.latency=0.1"; empty where nothing is changed."""
    return ", ".join(f"{key}={_shown(value)}" for key, value in changes.items())


def _chosen(config: DictConfig, choices: Mapping[str, str]) -> Iterator[tuple[str, str, list[str]]]:
    """Yield each node of the config that an episode depends on, with its group and the options chosen for it."""
    for group in GROUPS:
        if group in config:
            yield group, group, choices[group].split(SEVERAL) if group in choices else []
    for choice, option in choices.items():
        group, _, node = choice.partition("@")
        if node.startswith(HELD_OUT):
            yield node, group, [option]


def _written(names: Sequence[str], catalogue: Catalogue) -> dict[str, Any]:
    """The values in the files of options by dotted key, and those of a robot that its file leaves to the default."""
    defaults = [OmegaConf.structured(Robot)] if any(name.startswith("robot/") for name in names) else []
    merged: Any = OmegaConf.merge(*defaults, *(catalogue.values(name) for name in names)) if names else {}
    return dict(flatten(_plain(merged, resolve=False)))


def _plain(node: Any, *, resolve: bool) -> dict[str, Any]:
    found: Any = OmegaConf.to_container(node, resolve=resolve) if OmegaConf.is_config(node) else node
    return cast(dict[str, Any], found)


def _equal(written: Any, value: Any) -> bool:
    """Whether a value is as written. Plain YAML reads a float such as 1e0, without a point, as text."""
    try:
        return bool(written == value or (isinstance(value, float) and float(written) == value))
    except (TypeError, ValueError):
        return False


def _shown(value: Any) -> str:
    """A value as text without ", ", which separates the keys."""
    return str(value).replace(", ", ",")
