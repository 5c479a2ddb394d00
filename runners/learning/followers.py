"""What a robot does with the answers of its network, from one answer to the next."""

from __future__ import annotations

from typing import Protocol

from lme.guides.learned_subgoal.interface import SubgoalInterface
from lme.types import Floats, Observation, Planner, Twist
from runners.workers.lessons import Interface


class Follower(Protocol):
    """One robot in one episode. steps: control periods between two answers."""

    steps: int

    def features(self, observation: Observation, target: Floats) -> tuple[Floats, ...]:
        """The inputs of the network; called once before each answer."""

    def take(self, answer: Floats) -> None:
        """Follow this answer until the next."""

    def command(self, observation: Observation) -> Twist:
        """The command for one control period."""


class CommandFollower:
    """The answers of a planner's network are commands."""

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
    """The answers of a guide's network are subgoals, to which a planner drives."""

    def __init__(self, interface: SubgoalInterface, planner: Planner) -> None:
        self._interface, self._planner = interface, planner
        self.features, self.steps = interface.features, interface.steps

    def take(self, answer: Floats) -> None:
        """See `Follower`. answer: the number of a candidate."""
        self._interface.choose(int(answer))

    def command(self, observation: Observation) -> Twist:
        """See `Follower`."""
        return self._planner.plan(observation, self._interface.guidance(observation))
