"""Robots that a network drives to gain experience, many at once in `lme.gym.fleet.Fleet`.

A step lasts from one answer of the network to the next: a control period for a planner's network, `guide.period` for a
guide's. A follower turns each answer into commands until the next one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lme.errors import InputError, building
from lme.guides.learned_subgoal.guide import SubgoalInterface
from lme.guides.lme.weight_files import with_network
from lme.gym.episodes import Result, Reward
from lme.gym.fleet import Fleet, Transition, Views
from lme.robots import Robot
from lme.simulation.fast import FastConfig, FastSimulator
from lme.types import Bools, Floats, LaserScan, Limits, Observation, Outcome, Planner, Pose, Twist
from lme.worlds.world import MapSet, Task
from runners.config import build
from runners.config.instantiate import configured
from runners.config.schema import LearnConfig
from runners.learning.learnable import learned_config, learns_guide
from runners.learning.run import Run
from runners.workers.imitation_rollouts import Interface
from runners.workers.trials import draw_robot, ranged_keys, robot_with

if TYPE_CHECKING:
    from runners.learning.learners import Curriculum

Features = tuple[Tensor, ...]
_RECENT = 100  # episodes over which success is averaged
_PLANNERS = 0x706C  # seeds the planners that drive to subgoals separately from the episodes


class Experience(NamedTuple):
    """Result of a step of N robots, on the device of the network.

    features: those of the next observations. rewards (N,): sums over the step. terminated, truncated (N,): bool.
    ended (K,): numbers of the robots that are at the start of their next episode. last: features of these robots'
    final observations in the previous episode.
    """

    features: Features
    rewards: Tensor
    terminated: Tensor
    truncated: Tensor
    ended: Tensor
    last: Features


class Driving:
    """N robots in training worlds, observed as the network's features, with the target as the subgoal."""

    def __init__(
        self, run: Run, num_robots: int, worlds: int, reward: Reward, curriculum: Curriculum, part: int
    ) -> None:
        """Prepare the worlds. part: part of the training; each has different episodes."""
        config = run.config
        self._config, self._reward, self._curriculum = config, reward, curriculum
        self._network, self._device = run.network, run.device
        self._maps = _Worlds(config, run.places(0, worlds))
        self._num, self._seeds = num_robots, np.random.SeedSequence([config.seed, part])
        self._learned = learned_config(config)
        self._planner_rng = np.random.default_rng([config.seed, part, _PLANNERS])
        # Of the planners that drive to subgoals; reading it for every episode took half of the driving.
        self._planner = configured(with_network(config.planner), "planner")
        self.stage = 0
        self.episodes = 0
        self._returns = np.zeros(num_robots)
        self.ended_returns: deque[float] = deque(maxlen=_RECENT)
        self.recent: deque[bool] = deque(maxlen=_RECENT)

    def start(self, stage: int) -> Features:
        """Begin episodes of a stage of the curriculum; return the features of the first observations."""
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
        self._followers = [self._follower(self._views, i) for i in range(self._num)]
        return self._features(self._views)

    def step(self, answers: Tensor) -> Experience:
        """Drive until the next answer is due. answers: the network's, (N, …)."""
        for follower, answer in zip(self._followers, answers.cpu().double().numpy(), strict=True):
            follower.take(answer)
        # A robot whose episode ends stands still, without reward, for the rest of the step.
        rewards, ends = np.zeros(self._num), _Ends(self._num)
        for _ in range(self._followers[0].steps):
            done = self._fleet.step(self._commands(ends.ended))
            rewards += np.where(ends.ended, 0.0, done.rewards)
            self._take_ends(done, ends)
            self._views = done.views
        self._returns += rewards
        for i, result in ends.results.items():
            self._finished(i, result)
        return Experience(
            features=self._features(self._views),
            rewards=self._tensor(rewards.astype(np.float32)),
            terminated=self._tensor(ends.terminated),
            truncated=self._tensor(ends.ended & ~ends.terminated),
            ended=self._tensor(np.flatnonzero(ends.ended)),
            last=self._stacked([ends.last[i] for i in sorted(ends.last)]),
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
        """Return whether the current stage of the curriculum is done."""
        full = len(self.recent) == _RECENT and self.stage < len(self._curriculum.within)
        return full and self.success >= self._curriculum.promote

    def _finished(self, i: int, result: Result) -> None:
        self.episodes += 1
        self.recent.append(result.outcome is Outcome.SUCCESS)
        self.ended_returns.append(float(self._returns[i]))
        self._returns[i] = 0.0

    def _commands(self, standing: Bools) -> Floats:
        """Return commands (N, 2); robots at the start of an episode stand still until the next answer."""
        commands = np.zeros((self._num, 2))
        driving = np.flatnonzero(~standing).tolist()
        for i, observation in zip(driving, self._observations(self._views, driving), strict=True):
            commands[i] = self._followers[i].command(observation)
        return commands

    def _take_ends(self, done: Transition, ends: _Ends) -> None:
        """Record the episodes that ended in a control period, and begin the next ones."""
        for row, i in enumerate(done.ended.tolist()):
            if not ends.ended[i]:
                (final_view,) = self._observations(done.last_views, [row])
                ends.last[i] = self._followers[i].features(final_view, final_view.target)
                ends.ended[i], ends.terminated[i] = True, done.terminated[i]
                ends.results[i] = done.results[row]
            self._followers[i] = self._follower(done.views, i)

    def _features(self, views: Views) -> Features:
        """Return the features of all robots."""
        observations = self._observations(views, range(self._num))
        return self._stacked(
            [
                follower.features(observation, observation.target)
                for follower, observation in zip(self._followers, observations, strict=True)
            ]
        )

    def _stacked(self, rows: Sequence[tuple[Floats, ...]]) -> Features:
        """Stack the features of robots into tensors with a leading robot axis."""
        return tuple(
            self._tensor(np.array(feature_rows, np.float32)) for feature_rows in zip(*rows, strict=True)
        )

    def _tensor(self, array: NDArray[Any]) -> Tensor:
        return torch.from_numpy(array).to(self._device)

    def _observations(self, views: Views, rows: Iterable[int]) -> Iterator[Observation]:
        """Yield the observations of rows of `views`."""
        lidar, origin = self._config.robot.lidar, Pose(0.0, 0.0, 0.0)
        sensor = (lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)
        twists, commands, limits = views.twists.tolist(), views.commands.tolist(), views.limits.tolist()
        for row in rows:
            scan, target = LaserScan(views.ranges[row], *sensor), views.targets[row]
            twist, command = Twist(*twists[row]), Twist(*commands[row])
            yield Observation(scan, target, twist, Limits(*limits[row]), origin, last_command=command)

    def _follower(self, views: Views, row: int) -> Follower:
        """Return the follower of a robot at the start of an episode."""
        robot = _robot(self._config, views, row)
        interface = self._network.interface(self._learned, robot)
        if not learns_guide(self._config):
            return CommandFollower(interface)
        planner_class, planner_config = self._planner
        with building("planner"):
            planner = planner_class(planner_config, robot)
        planner.reset(self._planner_rng.spawn(1)[0])
        return SubgoalFollower(interface, planner)


class _Ends:
    """Episodes that ended in a step of N robots; `terminated` excludes timeouts."""

    def __init__(self, num: int) -> None:
        self.ended, self.terminated = np.zeros(num, dtype=bool), np.zeros(num, dtype=bool)
        self.last: dict[int, tuple[Floats, ...]] = {}
        self.results: dict[int, Result] = {}


class _Worlds:
    """All training map sets as one. Each world is built once, for all stages of the curriculum."""

    def __init__(self, config: LearnConfig, places: list[tuple[str, int]]) -> None:
        self._config = config
        self._names = {number: name for name, number in places}
        self.numbers = tuple(self._names)
        self.task = lru_cache(maxsize=None)(self._build)

    def with_tolerance(self, distance: float | None) -> MapSet:
        """Return the same worlds with success within this distance [m] of the goal; None: the map's own."""
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
    cls, simulator_config = configured(config.sim, "sim")
    if cls is not FastSimulator:
        raise InputError(
            "sim is not fast: reinforcement learning drives many robots at once, which only sim=fast can"
        )
    return cast(FastConfig, simulator_config)


def _robot(config: LearnConfig, views: Views, row: int) -> Robot:
    """Return the robot of a row: the job's robot, with the limits and the footprint drawn for it."""
    values = dict(zip(Limits._fields, views.limits[row].tolist(), strict=False))
    if config.robots.length is not None:
        half_length, half_width, _ = views.boxes[row].tolist()
        values |= {"length": 2 * half_length, "width": 2 * half_width}
    return robot_with(config.robot, values)


class Follower(Protocol):
    """Follower of answers, for one robot in one episode. steps: control periods between two answers."""

    steps: int

    def features(self, observation: Observation, target: Floats) -> tuple[Floats, ...]:
        """Return the inputs of the network; called once before each answer."""

    def take(self, answer: Floats) -> None:
        """Follow this answer until the next one."""

    def command(self, observation: Observation) -> Twist:
        """Return the command for one control period."""


class CommandFollower:
    """Follower of a planner's network, whose answers are commands."""

    steps = 1

    def __init__(self, interface: Interface) -> None:
        self._interface = interface
        self.features = interface.features

    def take(self, answer: Floats) -> None:
        """See `Follower`. answer: (2,) in [−1, 1]."""
        self._answer = answer

    def command(self, observation: Observation) -> Twist:
        """See `Follower`."""
        return self._interface.command(self._answer, observation)


class SubgoalFollower:
    """Follower of a guide's network, whose answers are subgoals that a planner drives to."""

    def __init__(self, interface: SubgoalInterface, planner: Planner) -> None:
        self._interface, self._planner = interface, planner
        self.features, self.steps = interface.features, interface.steps

    def take(self, answer: Floats) -> None:
        """See `Follower`. answer: the number of a candidate."""
        self._interface.choose(int(answer))

    def command(self, observation: Observation) -> Twist:
        """See `Follower`."""
        return self._planner.plan(observation, self._interface.guidance(observation))
