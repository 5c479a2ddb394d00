"""Runs the episodes of a candidate and scores them. Worker processes call this module during a training."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

from lme import metrics
from lme.episode import run_episode
from lme.navigator import Navigator
from lme.sim.simulator import Simulator
from lme.worlds.check import check_task
from lme.worlds.world import MapSet, Task
from runners.config import build
from runners.config.schema import TrainConfig
from runners.config.space import with_values
from runners.workers.disturbances import disturbed

Values = tuple[tuple[str, float], ...]
Place = tuple[str, int]  # a family and the number of a world


class Attempt(NamedTuple):
    """One episode of a candidate. trial: its number. world: of its family. values: by dotted config key."""

    trial: int
    family: str
    world: int
    values: Values

    def __str__(self) -> str:
        return f"trial {self.trial}, world {self.world} of {self.family}"


class Score(NamedTuple):
    """The result of an attempt. reward: paper eq. 1. Studies made before there were families have no `family`."""

    trial: int
    world: int
    outcome: str
    steps: int
    reward: float
    family: str = ""

    @property
    def place(self) -> Place:
        """Where it was driven."""
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
        found = maps(family).task(world)
        check_task(found, families[family].robot)
        return found

    @lru_cache(maxsize=64)
    def simulator(family: str, world: int | None) -> Simulator:
        return build.simulator(within(families[family], world))

    @lru_cache(maxsize=2 * len(families))  # the episodes of a candidate come one after the other
    def navigator(family: str, values: Values, world: int | None) -> Navigator:
        return build.navigator(within(with_values(families[family], dict(values)), world))

    def within(config: TrainConfig, world: int | None) -> TrainConfig:
        return config if world is None else disturbed(config, world)

    def run(attempt: Attempt) -> Score:
        family, world = attempt.family, attempt.world
        config, here = families[family], task(family, world)
        # Every candidate gets the same random numbers, so two rewards differ by the parameters alone.
        rng = np.random.default_rng(np.random.SeedSequence([config.seed, world, 0]))
        drawn = world if config.disturbances.any else None
        told = drawn if config.disturbances.latency else None  # a planner may know the delay of its world
        pilot, drive = navigator(family, attempt.values, told), simulator(family, drawn)
        episode = run_episode(here, pilot, drive, rng)
        reward = episode_reward(config, here.time_limit, str(episode.outcome), episode.steps)
        return Score(attempt.trial, world, str(episode.outcome), episode.steps, reward, family)

    return run


def episode_reward(config: TrainConfig, time_limit: float, outcome: str, steps: int) -> float:
    """Reward of an episode that took `steps` control periods. time_limit: of its task [s]."""
    terms = config.reward
    max_steps = terms.max_steps or round(time_limit * config.robot.control_rate)
    return metrics.reward(outcome, steps, max_steps, terms.crash, terms.timeout)
