"""Navigator: one guide and one planner."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np

from lme.errors import InputError, require
from lme.guides.lme.explanation import Decision, Explanation
from lme.inputs.returned import ReturnedError, checked_command, checked_guidance, checked_people
from lme.navigation.command_feedback import CommandFeedback
from lme.perception.people.source import PeopleSource
from lme.types import Feedback, Guidance, Guide, Observation, Planner, Pose, Twist
from lme.worlds.world import World


@runtime_checkable
class MapReader(Protocol):
    """A guide that can use the true map, like a robot with a map server."""

    def read_map(self, world: World, start: Pose) -> None:
        """Take the true world and the start pose in it. Called after `reset`."""


@runtime_checkable
class Explainable(Protocol):
    """A guide that can explain its last decision, such as LME."""

    def explanation(self) -> Explanation | None:
        """Return all quantities behind the last decision, None before the first. Changes no state."""


class Explanations:
    """Returns each explanation of a navigator once, since a guide may not run LME at every step."""

    def __init__(self, navigator: Navigator) -> None:
        self._navigator = navigator
        self._last_decision: Decision | None = None

    def new(self) -> Explanation | None:
        """Return the explanation if LME made a decision since the last call."""
        explanation = self._navigator.explanation()
        if explanation is None or explanation.decision is self._last_decision:
            return None
        self._last_decision = explanation.decision
        return explanation


class Navigator:
    """Asks the guide where to go and the planner how to get there.

    goal_tolerance: distance to the target below which it commands a stop [m]. 0: the caller decides when to stop.
    people: source of the people in observations; None: observations keep their own. feedback: from where commands
    ramp. dt: control period [s], in which commands, also those of a user's own planner, change no faster than the
    limits of acceleration allow; None: only the limits of velocity are enforced here, and acceleration is left to the
    planner.
    """

    def __init__(
        self,
        guide: Guide,
        planner: Planner,
        goal_tolerance: float = 0.0,
        people: PeopleSource | None = None,
        feedback: Feedback | str = Feedback.OPEN_LOOP,
        dt: float | None = None,
    ) -> None:
        require("goal_tolerance", goal_tolerance, at_least=0.0)
        self._feedback = CommandFeedback(feedback, dt)
        self.guide = guide
        self.planner = planner
        self.goal_tolerance = goal_tolerance
        self.people = people
        self.observation: Observation | None = (
            None  # of the last step, with the people whom guide and planner saw
        )
        self.guidance: Guidance | None = None  # of the last step
        self._steps = 0

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode. Guide and planner get separate random streams."""
        guide_rng, planner_rng = rng.spawn(2)
        self.guide.reset(guide_rng)
        self.planner.reset(planner_rng)
        if self.people is not None:
            self.people.reset()
        self.guidance = self.observation = None
        self._feedback.reset()
        self._steps = 0

    def read_map(self, world: World, start: Pose) -> None:
        """Give the true map to the guide if it is a `MapReader`."""
        if isinstance(self.guide, MapReader):
            self.guide.read_map(world, start)

    def explanation(self) -> Explanation | None:
        """Return the guide's explanation of its last decision; None before the first, or if it has none."""
        return self.guide.explanation() if isinstance(self.guide, Explainable) else None

    def act(self, observation: Observation, time: float | None = None) -> Twist:
        """Return the velocity command for one control period, within the limits and one ramp of the last command.

        Raises InputError, which names the step, if guide, planner or source of people return invalid values.
        time: of the scan [s], on any clock; None: one control period after the last one.
        """
        self._steps += 1
        try:
            return self._act(observation, time)
        except ReturnedError as error:
            raise InputError(f"step {self._steps}: {error}") from error

    def _act(self, observation: Observation, time: float | None) -> Twist:
        if self.people is not None:
            observation = checked_people(self.people.seen(observation, time), self.people)
        observation = self._feedback.completed(observation)
        self.observation = observation
        if math.hypot(*observation.target.tolist()) < self.goal_tolerance:
            command = Twist(0.0, 0.0)
        else:
            self.guidance = checked_guidance(self.guide.guide(observation), self.guide)
            command = checked_command(self.planner.plan(observation, self.guidance), self.planner)
        return self._feedback.limited(command, observation)
