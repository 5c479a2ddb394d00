"""Run the episodes of a candidate and score them. Worker processes call this module during a training."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from lme import metrics
from lme.errors import InputError, require
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.robots import Footprint, Robot
from lme.simulation.simulator import Simulator
from lme.worlds.check import check_task
from lme.worlds.world import MapSet, Task
from runners.config import build
from runners.config.build import simulator, with_disturbances
from runners.config.schema import RobotRanges, TrainConfig
from runners.config.space import with_values

_DISTURBANCES = 0x6469  # seeds the draw separately from the episode
Values = tuple[tuple[str, float], ...]
Place = tuple[str, int]  # a family and the number of a world
_SIDES = ("length", "width")


def disturbed(config: TrainConfig, world: int) -> TrainConfig:
    """Return the config with the disturbances drawn for a world; they are the same for every candidate."""
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, world, _DISTURBANCES]))
    values_drawn = {
        key: float(rng.uniform(*bounds)) for key, bounds in asdict(config.disturbances).items() if bounds
    }
    return with_disturbances(config, values_drawn)


def check_disturbances(config: TrainConfig) -> None:
    """Raise InputError for an invalid range, or a disturbance that the simulator does not have or refuses."""
    highest = {}
    for key, bounds in asdict(config.disturbances).items():
        if bounds is None:
            continue
        if len(bounds) != 2:
            raise InputError(f"disturbances.{key} is {bounds}: must be [lowest, highest] or null")
        if key not in config.sim:
            raise InputError(f"disturbances.{key}: this simulator has no {key}; choose sim=fast, or null")
        require(f"disturbances.{key}[0]", bounds[0], at_least=0.0)
        require(f"disturbances.{key}[1]", bounds[1], at_least=bounds[0])
        highest[key] = bounds[1]
    simulator(with_disturbances(config, highest))


class Attempt(NamedTuple):
    """One episode of a candidate. trial: its number. world: number in its family. values: by dotted config key."""

    trial: int
    family: str
    world: int
    values: Values

    def __str__(self) -> str:
        return f"trial {self.trial}, world {self.world} of {self.family}"


class Score(NamedTuple):
    """Result of an attempt. reward: paper eq. 1. Studies made before there were families have no `family`."""

    trial: int
    world: int
    outcome: str
    steps: int
    reward: float
    family: str = ""

    @property
    def place(self) -> Place:
        """Family and world that were driven."""
        return self.family, self.world


def initialise(families: Mapping[str, TrainConfig]) -> Callable[[Attempt], Score]:
    """Return the function that runs one attempt. Raises InputError.

    families: configs by name; the `map` of each holds the training worlds.
    """

    @cache
    def maps(family: str) -> MapSet:
        return build.map_set(families[family])

    @cache  # a training drives each world many times
    def task(family: str, world: int) -> Task:
        new_task = maps(family).task(world)
        check_task(new_task, families[family].robot)
        return new_task

    @lru_cache(maxsize=64)
    def simulator(family: str, world: int | None) -> Simulator:
        return build.simulator(within(families[family], world))

    @lru_cache(maxsize=2 * len(families))  # few: the episodes of a candidate come one after the other
    def navigator(family: str, values: Values, world: int | None) -> Navigator:
        return build.navigator(within(with_values(families[family], dict(values)), world))

    def within(config: TrainConfig, world: int | None) -> TrainConfig:
        return config if world is None else disturbed(config, world)

    def run(attempt: Attempt) -> Score:
        family, world = attempt.family, attempt.world
        config, task_driven = families[family], task(family, world)
        # Every candidate gets the same random numbers, so two rewards differ by the parameters alone.
        rng = np.random.default_rng(np.random.SeedSequence([config.seed, world, 0]))
        disturbance_seed = world if config.disturbances.any else None
        # A planner may know the delay of its world.
        known_latency_seed = disturbance_seed if config.disturbances.latency else None
        pilot = navigator(family, attempt.values, known_latency_seed)
        episode = run_episode(task_driven, pilot, simulator(family, disturbance_seed), rng)
        reward = episode_reward(config, task_driven.time_limit, str(episode.outcome), episode.steps)
        return Score(attempt.trial, world, str(episode.outcome), episode.steps, reward, family)

    return run


def episode_reward(config: TrainConfig, time_limit: float, outcome: str, steps: int) -> float:
    """Return the reward of an episode that took `steps` control periods. time_limit: that of its task [s]."""
    terms = config.reward
    max_steps = terms.max_steps or round(time_limit * config.robot.control_rate)
    return metrics.reward(outcome, steps, max_steps, terms.crash, terms.timeout)


def check_ranges(ranges: RobotRanges) -> None:
    """Raise InputError for an invalid range, and for one side of a footprint without the other."""
    for key in ranged_keys(ranges):
        interval = getattr(ranges, key)
        if len(interval) != 2 or interval[0] > interval[1]:
            raise InputError(f"robots.{key} is {interval}: must be [lowest, highest]")
        require(f"robots.{key}", interval[0], above=0.0)
    if (ranges.length is None) != (ranges.width is None):
        raise InputError("robots.length and robots.width: must both be ranges, or both null")


def draw_robot(robot: Robot, ranges: RobotRanges, rng: np.random.Generator) -> Robot:
    """Return the robot with values drawn from the ranges, uniformly in the logarithm."""
    drawn_values = {
        key: float(np.exp(rng.uniform(*np.log(getattr(ranges, key))))) for key in ranged_keys(ranges)
    }
    return robot_with(robot, drawn_values)


def extremes(robot: Robot, ranges: RobotRanges) -> tuple[Robot, Robot]:
    """Return the robots with the lowest and with the highest values of the ranges."""
    lowest, highest = ({key: getattr(ranges, key)[index] for key in ranged_keys(ranges)} for index in (0, 1))
    return robot_with(robot, lowest), robot_with(robot, highest)


def robot_with(robot: Robot, values: Mapping[str, float]) -> Robot:
    """Return the robot with these values of `RobotRanges`; both sides of a footprint, or neither."""
    limits = {key: value for key, value in values.items() if key not in _SIDES}
    if len(limits) == len(values):
        return replace(robot, **limits)  # type: ignore[arg-type]
    footprint = Footprint(length=values["length"], width=values["width"])
    drivetrain = robot.drivetrain and replace(robot.drivetrain, contact=None)
    return replace(robot, **limits, footprint=footprint, drivetrain=drivetrain, collision_radius=None)  # type: ignore[arg-type]


def ranged_keys(ranges: RobotRanges) -> list[str]:
    """Return the keys of the ranges that are not None."""
    return [field.name for field in fields(ranges) if getattr(ranges, field.name) is not None]
