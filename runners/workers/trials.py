"""Runs the episodes of a trial and scores them. Worker processes call this module during a search."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lme import metrics
from lme.episode import run_episode
from lme.navigator import Navigator
from lme.worlds.check import check_task
from lme.worlds.world import Task
from runners.config import build
from runners.config.schema import TrainConfig
from runners.config.space import with_values


class Attempt(NamedTuple):
    """One episode of a trial. world: number of the configuration. values: by dotted config key."""

    trial: int
    world: int
    values: tuple[tuple[str, float], ...]

    def __str__(self) -> str:
        return f"trial {self.trial}, configuration {self.world}"


class Score(NamedTuple):
    """The result of an attempt. reward: paper eq. 1."""

    trial: int
    world: int
    outcome: str
    steps: int
    reward: float


def initialise(config: TrainConfig) -> Callable[[Attempt], Score]:
    """Build everything once per process; return the function that runs one attempt.

    config: its `map` holds the training configurations. Raises InputError.
    """
    maps = build.map_set(config)
    simulator = build.simulator(config)
    tasks = {number: maps.task(number) for number in maps.numbers}
    for task in tasks.values():
        check_task(task, config.robot)

    @lru_cache(maxsize=2)  # the episodes of a trial come one after the other
    def navigator(values: tuple[tuple[str, float], ...]) -> Navigator:
        return build.navigator(with_values(config, dict(values)))

    def run(attempt: Attempt) -> Score:
        task = tasks[attempt.world]
        # Every trial gets the same random numbers, so two rewards differ by the parameters alone.
        rng = np.random.default_rng(np.random.SeedSequence([config.seed, attempt.world, 0]))
        episode = run_episode(task, navigator(attempt.values), simulator, rng)
        reward = episode_reward(config, task, str(episode.outcome), episode.steps)
        return Score(attempt.trial, attempt.world, str(episode.outcome), episode.steps, reward)

    return run


def episode_reward(config: TrainConfig, task: Task, outcome: str, steps: int) -> float:
    """Reward of an episode that took `steps` control periods."""
    terms = config.reward
    max_steps = terms.max_steps or round(task.time_limit * config.robot.control_rate)
    return metrics.reward(outcome, steps, max_steps, terms.crash, terms.timeout)
