"""Configs to objects: the only place that turns the one into the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError, require
from lme.navigator import Navigator
from lme.robots import Robot
from lme.sim.simulator import Simulator
from lme.worlds.check import check_task
from lme.worlds.world import MapSet
from runners.config import systems, weights
from runners.config.instantiate import build, configured, filled
from runners.config.schema import Record
from runners.workers import recorder

_CHECKED_TASKS = 20  # before anything runs; the rest as they are driven, for a task may be dear to build


def robot(config: Mapping[str, Any]) -> Robot:
    """The robot of a composed config. Raises InputError where a value is out of bounds."""
    return cast(Robot, filled(Robot, config["robot"], "robot"))


def map_set(config: Mapping[str, Any]) -> MapSet:
    """The map set of a composed config; where its `radius` is null, for the disc around the config's robot.

    The worlds that a figure's own `world` asks for come before those that the map chooses.
    """
    node = config["map"]
    if config.get("world") is not None:
        node = {**node, "worlds": worlds_of(config["world"])}
    if "radius" in node and node["radius"] is None:
        node = {**node, "radius": robot(config).footprint.r_max}
    return cast(MapSet, build(node, "map"))


def worlds_of(world: Any) -> list[int]:
    """A number, or a list of numbers, as a list. Raises InputError."""
    worlds = world if isinstance(world, list) else [world]
    if not worlds or any(isinstance(number, bool) or not isinstance(number, int) for number in worlds):
        raise InputError(f"world is {world!r}: must be a number, or a list of numbers")
    return worlds


def navigator(config: Mapping[str, Any], robot: Robot) -> Navigator:
    """Guide and planner of a composed config. Raises InputError for factors on parameters that the guide lacks."""
    weights.check_scale(config.get("scale", {}), config["guide"])
    guide = build(config["guide"], "guide", robot)
    planner = build(config["planner"], "planner", robot)
    return Navigator(guide, planner)


def simulator(config: Mapping[str, Any], robot: Robot) -> Simulator:
    """The simulator of a composed config."""
    return cast(Simulator, build(config["sim"], "sim", robot))


def validate(config: DictConfig) -> None:
    """Build what is cheap to build and check the rest, so that mistakes show before anything runs."""
    systems.check_names(config.table)
    if config.record == Record.mcap:
        recorder.check_installed()
    configured(config.tracking, "tracking")
    check_drive(config, _CHECKED_TASKS)


def check_drive(config: Mapping[str, Any] | DictConfig, num_tasks: int | None = None) -> None:
    """Raise InputError where a system, or one of its first `num_tasks` tasks, is not right; None: of all."""
    systems.check_implemented(config["system"] or {})
    require("runs", config["runs"], at_least=1)
    require("seed", config["seed"], at_least=0)
    machine = robot(config)
    configured(config["executor"], "executor")
    maps = map_set(config)
    for number in maps.numbers[:num_tasks]:
        check_task(maps.task(number), machine)
    navigator(config, machine)
    simulator(config, machine)


def plain(config: DictConfig) -> dict[str, Any]:
    """The resolved config as plain containers, fit to be pickled, hashed and written."""
    resolved = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    if not isinstance(resolved, dict):
        raise InputError("the config must be a mapping")
    return cast(dict[str, Any], resolved)
