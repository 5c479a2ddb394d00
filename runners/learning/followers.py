"""Followers, which turn each answer of a robot's network into commands until the next answer."""

from __future__ import annotations

from typing import Protocol

from lme.guides.learned_subgoal.guide import SubgoalInterface
from lme.types import Floats, Observation, Planner, Twist
from runners.workers.imitation_rollouts import Interface


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
