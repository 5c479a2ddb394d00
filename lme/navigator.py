"""A navigator: one guide and one planner."""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol, runtime_checkable

import numpy as np

from lme.dead_reckoning import DeadReckoning
from lme.errors import InputError, require
from lme.policies.lme.explanation import Decision, Explanation
from lme.ramp import reachable
from lme.returned import ReturnedError, checked_command, checked_guidance, checked_people
from lme.sensing.people.source import PeopleSource
from lme.types import Feedback, Guidance, Guide, Observation, Planner, Pose, Twist
from lme.worlds.world import World

_HELD_FOR = 2.0  # [s]
_ASKED_M, _ASKED_RAD = 0.1, 0.2  # less, commanded over that time, tells nothing
_FOLLOWED = 0.2  # share of the commanded motion


@runtime_checkable
class MapReader(Protocol):
    """A guide that can use the true map, like a robot with a map server."""

    def read_map(self, world: World, start: Pose) -> None:
        """Take the true world and the start pose in it. Called after `reset`."""


@runtime_checkable
class Explainable(Protocol):
    """A guide that can explain its last decision, such as LME."""

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first. Changes no state."""


class Explanations:
    """Returns each explanation of a navigator once: a guide may not ask LME at every step."""

    def __init__(self, navigator: Navigator) -> None:
        self._navigator = navigator
        self._given: Decision | None = None

    def new(self) -> Explanation | None:
        """The explanation if LME made a decision since the last call."""
        why = self._navigator.explanation()
        if why is None or why.decision is self._given:
            return None
        self._given = why.decision
        return why


class HeldCheck:
    """Notices a robot that does not follow its commands: it is lifted, blocked, or stopped by an emergency switch.

    Then commands ramp from the measured motion again, so that the robot does not leap when it is let go.
    """

    def __init__(self, dt: float) -> None:
        """dt: control period [s]."""
        self._dt = dt
        self.reset()

    def reset(self) -> None:
        """Forget the motion so far."""
        self._reckoning = DeadReckoning(self._dt)
        self._periods: deque[tuple[float, ...]] = deque(maxlen=max(round(_HELD_FOR / self._dt), 1))

    def by(self, observation: Observation) -> bool:
        """Whether the robot has made less than a fifth of the commanded way, or turn, over the last two seconds."""
        move, command = self._reckoning.move(observation), observation.last_command
        if move is None or command is None:
            return False
        rates = self._reckoning.velocity(move)
        self._periods.append((*command, *rates))
        if len(self._periods) < (self._periods.maxlen or 0):
            return False
        v, omega, moved_v, moved_omega = (
            self._dt * sum(column) for column in zip(*self._periods, strict=True)
        )
        return _behind(v, moved_v, _ASKED_M) or _behind(omega, moved_omega, _ASKED_RAD)


def _behind(asked: float, done: float, least: float) -> bool:
    """Whether less than a fifth of a motion that was asked for was done."""
    return abs(asked) > least and math.copysign(1.0, asked) * done < _FOLLOWED * abs(asked)


class Navigator:
    """Asks the guide where to go and the planner how to get there.

    goal_tolerance: nearer to the target than this [m] it commands a stop. 0: whoever drives it decides when to stop.
    people: puts people into observations; None: they keep those whom they have. feedback: from where commands ramp.
    dt: control period [s], in which commands, also those of a user's own planner, change no faster than the limits of
    acceleration allow; None: the planner alone sees to that, and the limits of velocity alone are kept here.
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
        if feedback not in list(Feedback):
            raise InputError(f"feedback is {feedback!r}: must be one of {', '.join(Feedback)}")
        self._feedback, self._dt = feedback, dt
        self._held = None if dt is None else HeldCheck(dt)
        self.guide = guide
        self.planner = planner
        self.goal_tolerance = goal_tolerance
        self.people = people
        self.observation: Observation | None = (
            None  # of the last step, with the people whom guide and planner saw
        )
        self.guidance: Guidance | None = None  # of the last step
        self._steps, self._last = 0, Twist(0.0, 0.0)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode. Guide and planner get separate random streams."""
        guide_rng, planner_rng = rng.spawn(2)
        self.guide.reset(guide_rng)
        self.planner.reset(planner_rng)
        if self.people is not None:
            self.people.reset()
        self.guidance = self.observation = None
        self._steps, self._last = 0, Twist(0.0, 0.0)
        if self._held is not None:
            self._held.reset()

    def read_map(self, world: World, start: Pose) -> None:
        """Give the true map to the guide if it is a `MapReader`."""
        if isinstance(self.guide, MapReader):
            self.guide.read_map(world, start)

    def explanation(self) -> Explanation | None:
        """The guide's explanation of its last decision; None before the first, or if it cannot explain."""
        return self.guide.explanation() if isinstance(self.guide, Explainable) else None

    def act(self, observation: Observation, time: float | None = None) -> Twist:
        """Velocity command for one control period, within the limits and within one ramp of the last.

        Raises InputError, which names the step, if guide, planner or source of people return what cannot be used.
        time: when the scan was taken [s], on any clock; None: one control period after the last one.
        """
        self._steps += 1
        try:
            return self._act(observation, time)
        except ReturnedError as error:
            raise InputError(f"step {self._steps}: {error}") from error

    def _act(self, observation: Observation, time: float | None) -> Twist:
        if self.people is not None:
            observation = checked_people(self.people.seen(observation, time), self.people)
        if observation.last_command is None:
            observation = observation._replace(last_command=self._last)
        held = self._held is not None and self._held.by(observation)
        if held or self._feedback == Feedback.CLOSED_LOOP:
            observation = observation._replace(closed_loop=True)
        self.observation = observation
        if math.hypot(*observation.target.tolist()) < self.goal_tolerance:
            command = Twist(0.0, 0.0)
        else:
            self.guidance = checked_guidance(self.guide.guide(observation), self.guide)
            command = checked_command(self.planner.plan(observation, self.guidance), self.planner)
        self._last = self._within_limits(command, observation)
        return self._last

    def _within_limits(self, command: Twist, observation: Observation) -> Twist:
        """The command, or the nearest that the limits allow."""
        limits = observation.limits
        if self._dt is None:
            return limits.clamped(command)
        return reachable(*command, observation.ramp_start, limits, self._dt)
