"""Drive the episodes of `lme learn`: an expert labels what a network sees, or a network is evaluated alone.

Worker processes call this module. It treats networks as planners and does not need torch.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from time import process_time
from typing import Any, NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from lme.guides.lme.weight_files import with_network
from lme.gym.episodes import WORLDS_KEPT
from lme.inputs.returned import checked_command, checked_guidance
from lme.navigation.episode import run_episode
from lme.navigation.navigator import MapReader, Navigator
from lme.robots import Robot
from lme.types import Floats, Guide, Observation, Planner, Pose, Twist
from lme.worlds.check import check_task
from lme.worlds.world import Task, World
from runners.config import build, instantiate
from runners.config.schema import LearnConfig
from runners.workers.trials import draw_robot

Arrays = tuple[NDArray[np.float32], ...]
_ROBOT, _DRIVER = 0x726F, 0x6472  # seed the robot and the choice of driver separately from the episode
_TURN = (5, 25)  # steps that the expert or the network drives before the driver may change


class Interface(Protocol):
    """Inputs of a network, and the meaning of its output: `lme.planners.dclp.planner`."""

    def features(self, observation: Observation, subgoal: Floats) -> tuple[Floats, ...]:
        """Return the inputs of the network; called once per step. subgoal: the point to drive to (2,) [m]."""

    def action(self, command: Twist, observation: Observation) -> Floats:
        """Return the output that stands for a command."""

    def command(self, action: Floats, observation: Observation) -> Twist:
        """Return the command that an output stands for."""


class NetworkPlanner(Planner, Protocol):
    """Planner whose commands come from a network. seen: the inputs of the network at the last step."""

    interface: Interface
    seen: tuple[Floats, ...] | None


class ImitationRollout(NamedTuple):
    """One episode. maps: name of a training map set. world: its number. guide: gives the network its subgoals.

    network: path of its weights. beta: share of the steps that the expert drives, or None to evaluate the network,
    which then drives the job's robot alone. time_limit: replaces the map's [s].
    """

    maps: str
    world: int
    guide: str
    network: str
    beta: float | None
    time_limit: float | None = None

    def __str__(self) -> str:
        return f"world {self.world} of {self.maps} under {self.guide}"


class RolloutResult(NamedTuple):
    """Result of a rollout of T steps.

    features: one array (T, …) for each input of the network; actions: the expert's, (T, A). Both are empty if the
    network was evaluated. process: that drove it, with the processor time that it has used so far [s].
    """

    rollout: ImitationRollout
    outcome: str
    features: Arrays
    actions: NDArray[np.float32]
    process: tuple[int, float]


@dataclass(frozen=True, slots=True)
class Expert:
    """Config of the expert's planner, and of the guide that it follows if the network's subgoal is the target.

    guide: None if the expert follows the network's guide.
    """

    planner: Mapping[str, Any]
    guide: Mapping[str, Any] | None


@dataclass(frozen=True, slots=True)
class RolloutPayload:
    """Everything that a worker needs. guides: their configs by name. expert: None if networks are only evaluated.

    learned: the part that has the network, "guide" or "planner".
    """

    config: LearnConfig
    guides: Mapping[str, Mapping[str, Any]]
    expert: Expert | None
    learned: str = "planner"


def initialise(payload: RolloutPayload) -> Callable[[ImitationRollout], RolloutResult]:
    """Return the function that runs one rollout. Raises InputError."""
    config = payload.config

    @lru_cache(maxsize=WORLDS_KEPT)  # every evaluation of a network drives the same validation worlds
    def task_of(maps: str, world: int) -> Task:
        return build.map_set(replace(config, map=config.training[maps]), [world]).task(world)

    def run(rollout: ImitationRollout) -> RolloutResult:
        task = task_of(rollout.maps, rollout.world)
        rng = np.random.default_rng(np.random.SeedSequence([config.seed, rollout.world, 0]))
        # Evaluation: the network alone, on the job's own robot.
        if rollout.beta is None:
            check_task(task, config.robot)
            navigator = Navigator(*_student(payload, rollout, config.robot))
            episode = run_episode(task, navigator, build.simulator(config), rng)
            return RolloutResult(rollout, str(episode.outcome), (), np.empty((0, 0), np.float32), _cost())
        # ImitationRollout: the network and the expert together, on a robot drawn for this world.
        task = replace(task, time_limit=rollout.time_limit or task.time_limit)
        robot = draw_robot(config.robot, config.robots, _rng(config.seed, rollout.world, _ROBOT))
        pair = TeachingNavigator(payload, rollout, robot)
        simulator = build.simulator(replace(config, robot=robot))
        outcome = run_episode(task, pair, simulator, rng).outcome
        return RolloutResult(rollout, str(outcome), *pair.labels(), _cost())

    return run


class TeachingNavigator(Navigator):
    """Navigator of a network and an expert: both decide at every step, one drives, and everything is recorded."""

    def __init__(self, payload: RolloutPayload, rollout: ImitationRollout, robot: Robot) -> None:
        guide, student = _student(payload, rollout, robot)
        super().__init__(guide, student)
        expert = payload.expert
        assert expert is not None
        self._student = cast(NetworkPlanner, student)
        with _without_warnings():
            self._expert: Planner = instantiate.build(
                with_network(expert.planner), "learner.expert", robot=robot
            )
        expert_guide = expert.guide if rollout.guide == "target" else None
        self._guide: Guide | None = (
            None
            if expert_guide is None
            else instantiate.build(expert_guide, "learner.expert.guide", robot=robot)
        )
        self._beta = rollout.beta or 0.0
        self._expert_drives, self._remaining_steps = False, 0
        self._driver = _rng(payload.config.seed, rollout.world, _DRIVER)
        self._features: list[tuple[Floats, ...]] = []
        self._actions: list[Floats] = []

    def reset(self, rng: np.random.Generator) -> None:
        expert_rng, guide_rng = rng.spawn(2)
        super().reset(rng)
        self._expert.reset(expert_rng)
        if self._guide is not None:
            self._guide.reset(guide_rng)

    def read_map(self, world: World, start: Pose) -> None:
        super().read_map(world, start)
        if isinstance(self._guide, MapReader):
            self._guide.read_map(world, start)

    def act(self, observation: Observation, time: float | None = None) -> Twist:
        command = super().act(observation, time)
        # The expert labels every step, whoever drives; it has its own guide only under the target.
        assert self.guidance is not None
        guidance = self.guidance
        if self._guide is not None:
            guidance = checked_guidance(self._guide.guide(observation), self._guide)
        advice = checked_command(self._expert.plan(observation, guidance), self._expert)
        assert self._student.seen is not None
        self._features.append(self._student.seen)
        self._actions.append(self._student.interface.action(advice, observation))
        return advice if self._let_expert_drive() else command

    def _let_expert_drive(self) -> bool:
        """Return whether the expert drives.

        The driver may change only after some steps, so that the network's mistakes show.
        """
        if self._remaining_steps == 0:
            self._expert_drives = bool(self._driver.random() < self._beta)
            self._remaining_steps = int(self._driver.integers(*_TURN))
        self._remaining_steps -= 1
        return self._expert_drives

    def labels(self) -> tuple[Arrays, NDArray[np.float32]]:
        """Return the features (T, …) and the expert's actions (T, A) so far."""
        features = tuple(np.array(arrays, np.float32) for arrays in zip(*self._features, strict=True))
        return features, np.array(self._actions, np.float32)


def _student(payload: RolloutPayload, rollout: ImitationRollout, robot: Robot) -> tuple[Guide, Planner]:
    """Build guide and planner, one of which uses the rollout's network."""
    nodes = {"guide": payload.guides[rollout.guide], "planner": payload.config.planner}
    nodes[payload.learned] = {**nodes[payload.learned], "weights": rollout.network}
    with _without_warnings():
        guide, planner = (
            instantiate.build(with_network(node, group), group, robot=robot) for group, node in nodes.items()
        )
    return guide, planner


def _cost() -> tuple[int, float]:
    """Return the number of this process, and the processor time that it has used [s]."""
    return os.getpid(), process_time()


def _without_warnings() -> warnings.catch_warnings[None]:
    """Ignore the warning that a planner's network was not trained for the robot, since it is being trained now."""
    return warnings.catch_warnings(action="ignore", category=UserWarning)


def _rng(seed: int, world: int, purpose: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence([seed, world, purpose]))
