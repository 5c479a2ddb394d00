"""Families of worlds that a training drives, and the worlds drawn from each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from lme.errors import InputError, nearest
from lme.robots import Robot
from runners.config import build
from runners.config.changes import TRAINING
from runners.config.schema import DriveConfig, TrainConfig

Families = dict[str, TrainConfig]  # by name: the config with the family's map and robot
_TRAINING = 0x7472  # seeds the draw of worlds separately from the episodes


def families(config: TrainConfig, choices: Mapping[str, str]) -> Families:
    """Return the chosen map, or the families of `training` that are wide enough for the robot.

    A family is driven by its own robot if that is larger than the one trained for. Raises InputError if none is left.
    """
    check_left_out(config.training, choices)
    if config.map:
        return {choices["map"]: config}
    for key in ("training_robots", "training_radius"):
        unknown = sorted(getattr(config, key).keys() - config.training.keys())
        if unknown:
            raise InputError(
                f"{key}.{unknown[0]}: no such family; must be one of {', '.join(config.training)}"
                "; training.NAME=null leaves a family out"
            )
    suitable = {
        name: replace(config, map=node, robot=_driver(config, name))
        for name, node in config.training.items()
        if node is not None and name not in too_narrow(config)
    }
    if not suitable:
        left_out = f". {describe_too_narrow(config)}" if too_narrow(config) else ""
        raise InputError(
            f"training has no family of worlds for {config.robot.name}: give one with map@training.NAME=MAP, or train "
            f"on one map alone with map=MAP{left_out}"
        )
    return suitable


def check_left_out(training: Mapping[str, object], choices: Mapping[str, str]) -> None:
    """Raise InputError for a family that `training.NAME=null` leaves out, but that no option has chosen."""
    known = [name for name in training if f"map@{TRAINING}{name}" in choices]
    for name, node in training.items():
        if node is None and name not in known:
            raise InputError(
                f"training.{name}: no such family; {nearest(name, known)}must be one of {', '.join(known)}"
            )


def check_map_alone(map_option: str, overrides: Iterable[str]) -> None:
    """Raise InputError for families on the command line if a map is chosen, which is trained on alone."""
    prefixes = (
        "map@training.",
        "training.",
        "training_robots.",
        "training_radius.",
        "robot@training_robots.",
    )
    words = [word.lstrip("+~") for word in overrides]
    ignored = [word for word in words if word.startswith(prefixes) and not word.endswith("=null")]
    if ignored:
        raise InputError(
            f"map is {map_option}: trains on that map alone, so {ignored[0]} would have no effect; to train on several,"
            f" leave out map= and give map@training.NAME={map_option}, with its keys as training.NAME.KEY=VALUE;"
            " a robot larger than training_radius.NAME [m] is not trained on that family"
        )


def too_narrow(config: TrainConfig) -> list[str]:
    """Return the families whose worlds are too narrow for the robot."""
    if config.map:
        return []
    return [
        name
        for name, radius in config.training_radius.items()
        if config.robot.footprint.circumscribed_radius > radius
    ]


def describe_too_narrow(config: TrainConfig) -> str:
    """Return which families are too narrow, and what trains on them nevertheless; there must be one."""
    names = too_narrow(config)
    radius = math.ceil(config.robot.footprint.circumscribed_radius * 100.0) / 100.0
    limits = " and ".join(f"training_radius.{name} is {config.training_radius[name]:g}" for name in names)
    words = " ".join(f"training_radius.{name}={radius:.2f}" for name in names)
    return (
        f"Not on {', '.join(names)}: too narrow for an outer radius of {radius:.2f} m, {limits}; "
        f"to train on {'it' if len(names) == 1 else 'them'} nevertheless: {words}"
    )


def _driver(config: TrainConfig, name: str) -> Robot:
    family_robot = config.training_robots.get(name, config.robot)
    return (
        family_robot
        if family_robot.footprint.circumscribed_radius > config.robot.footprint.circumscribed_radius
        else config.robot
    )


def training_worlds(config: TrainConfig, held_out: Iterable[DriveConfig], count: int) -> list[int]:
    """Draw the numbers of the worlds to train on, once per seed and for all families, without those held out.

    held_out: configs whose maps have the worlds of the evaluation. The first numbers are the same for every `count`.
    Raises InputError if there are too few to draw from.
    """
    numbers = config.training_numbers
    if len(numbers) != 2 or not 0 <= numbers[0] <= numbers[1]:
        raise InputError(f"training_numbers is {numbers}: must be [first, last], from 0 on")
    lowest, highest = numbers
    reserved = {number for map_config in held_out for number in build.map_set(map_config).numbers}
    available = highest - lowest + 1 - sum(lowest <= number <= highest for number in reserved)
    if available < count:
        raise InputError(
            f"training_numbers is {numbers}: must leave {count} worlds besides those held out, but leaves {available}"
        )
    # Draw one by one, so that a larger count only adds numbers at the end.
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, _TRAINING]))
    numbers_drawn: dict[int, None] = {}
    while len(numbers_drawn) < count:
        number = int(rng.integers(lowest, highest + 1))
        if number not in reserved:
            numbers_drawn[number] = None
    return list(numbers_drawn)


def with_worlds(trained: Families, worlds: Sequence[int]) -> Families:
    """Return the families with these worlds. Raises InputError if one does not have them."""
    families_with_worlds = {
        name: replace(family, map={**family.map, "worlds": list(worlds)}) for name, family in trained.items()
    }
    for name, family in families_with_worlds.items():
        try:
            build.map_set(family)
        except InputError as error:
            chosen = trained[name].map
            key = f"training.{name}" if family.training.get(name) is chosen else "map"
            fresh = f"; {key}.subset=fresh has all of them" if "subset" in chosen else ""
            raise InputError(
                f"training_numbers is {family.training_numbers}: must be worlds that {name} has, such as [0,299] "
                f"with map=barn and its lab100 held out ({error}){fresh}"
            ) from error
    return families_with_worlds
