"""Robots that a network drives to gain experience: many at once, by `lme.envs.fleet.Fleet`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple, cast

import numpy as np
import torch
from torch import Tensor

from lme.envs.fleet import Fleet, Views
from lme.envs.reward import Result, Reward
from lme.errors import InputError
from lme.robots import Robot
from lme.sim.fast import FastConfig, FastSimulator
from lme.types import LaserScan, Limits, Observation, Outcome, Pose, Twist
from lme.worlds.world import MapSet, Task
from runners.config import build
from runners.config.instantiate import configured
from runners.config.schema import LearnConfig
from runners.learning.learnable import planner_config
from runners.learning.run import Run
from runners.learning.settings import Curriculum
from runners.workers.lessons import Interface
from runners.workers.robots import draw_robot, ranged_keys, robot_with

Features = tuple[Tensor, ...]
_RECENT = 100  # episodes over which success is averaged


class Experience(NamedTuple):
    """The result of a step of N robots.

    features: of what they see next. rewards (N,). terminated, truncated (N,) bool. ended (K,): robots at the start of
    their next episode, with `last`, the features of what they saw at the end of the previous one.
    """

    features: Features
    rewards: Tensor
    terminated: Tensor
    truncated: Tensor
    ended: Tensor
    last: Features


class Driving:
    """N robots in training worlds, observed as the network's features, with the target as subgoal."""

    def __init__(
        self, run: Run, num_robots: int, worlds: int, reward: Reward, curriculum: Curriculum, part: int
    ) -> None:
        """part: of the training; each part has other episodes."""
        config = run.config
        self._config, self._reward, self._curriculum = config, reward, curriculum
        self._network = run.network
        self._maps = _Worlds(config, run.places(0, worlds))
        self._num, self._seeds = num_robots, np.random.SeedSequence([config.seed, part])
        self._planner = planner_config(config.planner)
        self.stage = 0
        self.episodes = 0
        self._returns = np.zeros(num_robots)
        self.ended_returns: deque[float] = deque(maxlen=_RECENT)
        self.recent: deque[bool] = deque(maxlen=_RECENT)

    def start(self, stage: int) -> Features:
        """Begin episodes of a stage of the curriculum; returns what the robots see."""
        self.stage = stage
        self.recent.clear()
        within = [*self._curriculum.within, None][stage]
        config = self._config
        robot = (
            (lambda rng: draw_robot(config.robot, config.robots, rng))
            if ranged_keys(config.robots)
            else config.robot
        )
        self._fleet = Fleet(
            self._maps.with_tolerance(within), robot, self._num, _simulator(config), self._reward
        )
        seeds = [int(child.generate_state(1)[0]) for child in self._seeds.spawn(self._num)]
        self._views = self._fleet.reset(seeds)
        self._returns[:] = 0.0
        self._interfaces = [self._interface(self._views, i) for i in range(self._num)]
        return self._features(self._views, range(self._num))

    def step(self, actions: Tensor) -> Experience:
        """Drive one control period. actions: (N, 2) in [−1, 1]."""
        pairs = enumerate(actions.double().numpy())
        commands = [self._interfaces[i].command(each, self._observation(self._views, i)) for i, each in pairs]
        done = self._fleet.step(np.array(commands))
        self._returns += done.rewards
        last = self._features(done.last_views, done.ended)
        for k, i in enumerate(done.ended):
            self._interfaces[i] = self._interface(done.views, int(i))
            self._finished(int(i), done.results[k])
        self._views = done.views
        features = self._features(done.views, range(self._num))
        return Experience(
            features=features,
            rewards=torch.from_numpy(done.rewards).float(),
            terminated=torch.from_numpy(done.terminated),
            truncated=torch.from_numpy(done.truncated),
            ended=torch.from_numpy(done.ended),
            last=last,
        )

    @property
    def success(self) -> float:
        """Share of successes among the last episodes; NaN before the first."""
        return sum(self.recent) / len(self.recent) if self.recent else math.nan

    @property
    def mean_return(self) -> float:
        """Mean sum of the rewards of the last episodes; NaN before the first."""
        return sum(self.ended_returns) / len(self.ended_returns) if self.ended_returns else math.nan

    @property
    def promoted(self) -> bool:
        """Whether the current stage of the curriculum is done."""
        full = len(self.recent) == _RECENT and self.stage < len(self._curriculum.within)
        return full and self.success >= self._curriculum.promote

    def _finished(self, i: int, result: Result) -> None:
        self.episodes += 1
        self.recent.append(result.outcome is Outcome.SUCCESS)
        self.ended_returns.append(float(self._returns[i]))
        self._returns[i] = 0.0

    def _features(self, views: Views, robots: Iterable[int]) -> Features:
        """Features of the rows of `views`, which are those of `robots`."""
        rows = []
        for row, i in enumerate(robots):
            rows.append(self._interfaces[int(i)].features(self._observation(views, row), views.targets[row]))
        return tuple(torch.from_numpy(np.array(each, np.float32)) for each in zip(*rows, strict=True))

    def _observation(self, views: Views, row: int) -> Observation:
        lidar = self._config.robot.lidar
        scan = LaserScan(
            views.ranges[row], lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max
        )
        twist, limits = Twist(*views.twists[row].tolist()), Limits(*views.limits[row].tolist())
        return Observation(scan, views.targets[row], twist, limits, Pose(0.0, 0.0, 0.0))

    def _interface(self, views: Views, row: int) -> Interface:
        return self._network.interface(self._planner, _robot(self._config, views, row))


class _Worlds:
    """The training map sets as one. Each world is built once, for all stages of the curriculum."""

    def __init__(self, config: LearnConfig, places: list[tuple[str, int]]) -> None:
        self._config = config
        self._names = {number: name for name, number in places}
        self.numbers = tuple(self._names)
        self.task = lru_cache(maxsize=None)(self._build)

    def with_tolerance(self, distance: float | None) -> MapSet:
        """The same worlds, with success within this distance of the goal [m]; None: the map's own."""
        return cast(MapSet, self if distance is None else _EasierWorlds(self, distance))

    def _build(self, number: int) -> Task:
        node = self._config.training[self._names[number]]
        return build.map_set(replace(self._config, map=node), [number]).task(number)


class _EasierWorlds:
    def __init__(self, worlds: _Worlds, distance: float) -> None:
        self.numbers, self._worlds, self._distance = worlds.numbers, worlds, distance

    def task(self, number: int) -> Task:
        task = self._worlds.task(number)
        return replace(task, goal_tolerance=max(self._distance, task.goal_tolerance))


def check_driving(config: LearnConfig) -> None:
    """Raise InputError for a simulator or a robot that cannot be stepped with many others at once."""
    Fleet(build.map_set(config), config.robot, 1, _simulator(config))


def _simulator(config: LearnConfig) -> FastConfig:
    cls, found = configured(config.sim, "sim")
    if cls is not FastSimulator:
        raise InputError(
            "sim is not fast: reinforcement learning drives many robots at once, which only sim=fast can"
        )
    return cast(FastConfig, found)


def _robot(config: LearnConfig, views: Views, row: int) -> Robot:
    """The robot of a row: the job's robot, with the limits and the footprint drawn for it."""
    values = dict(zip(Limits._fields, views.limits[row].tolist(), strict=False))
    if config.robots.length is not None:
        half_length, half_width, _ = views.boxes[row].tolist()
        values |= {"length": 2 * half_length, "width": 2 * half_width}
    return robot_with(config.robot, values)
