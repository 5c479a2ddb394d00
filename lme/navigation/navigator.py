"""Navigator: one guide and one planner, and the motion to which its commands have led."""

from __future__ import annotations

import math
import warnings
from collections import deque
from typing import Protocol, runtime_checkable

import numpy as np

from lme.errors import InputError, require
from lme.guides.lme.explanation import Decision, Explanation
from lme.inputs import plausibility
from lme.inputs.returned import ReturnedError, checked_command, checked_guidance, checked_people
from lme.inputs.user_code import dotted_name
from lme.navigation.observation_check import ObservationCheck
from lme.perception.dead_reckoning import DeadReckoning, Move
from lme.perception.people.source import PeopleSource
from lme.robots import Cap, Lidar, reachable
from lme.types import Feedback, Guidance, Guide, Observation, Planner, Pose, Twist
from lme.worlds.world import World

_STILL = Twist(0.0, 0.0)
_HELD_FOR = 2.0  # [s]
_MIN_M, _MIN_RAD = 0.1, 0.2  # less commanded motion over that time is inconclusive
_FOLLOWED = 0.2  # share of the commanded motion
_MOVED_M = 0.02  # in a control period: more than the noise of the odometry


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
    planner. cap: lowers the limits that guide and planner see; build them for `robot.capped(cap)`. lidar: of the robot;
    with it the observations are checked, as those of a user's own program must be. None: they are checked elsewhere.
    """

    def __init__(
        self,
        guide: Guide,
        planner: Planner,
        goal_tolerance: float = 0.0,
        people: PeopleSource | None = None,
        feedback: Feedback | str = Feedback.OPEN_LOOP,
        dt: float | None = None,
        cap: Cap | None = None,
        lidar: Lidar | None = None,
    ) -> None:
        require("goal_tolerance", goal_tolerance, at_least=0.0)
        if goal_tolerance > 0.0:
            plausibility.check("goal_tolerance", goal_tolerance)
        if dt is not None:
            require("dt", dt, above=0.0)
            plausibility.check("dt", dt)
        parts = [("guide", guide, "guide"), ("planner", planner, "plan")]
        for key, part, method in parts if people is None else [*parts, ("people", people, "seen")]:
            if not hasattr(part, method):
                raise InputError(f"{key} is {part!r:.80}: must have a method {method}")
            if isinstance(part, type):
                raise InputError(f"{key} is the class {part.__qualname__}: must be an instance of it")
        for key, value, kind in (("cap", cap, Cap), ("lidar", lidar, Lidar)):
            if not isinstance(value, kind | None):
                raise InputError(f"{key} is {value!r:.80}: must be a lme.robots.{kind.__name__}, or None")
        self._feedback = CommandFeedback(feedback, dt)
        self.guide = guide
        self.planner = planner
        self.goal_tolerance = goal_tolerance
        self.people = people
        self.cap = cap or Cap()
        self._check = lidar and ObservationCheck(lidar, dt)
        # Of the last step, with the people whom guide and planner saw.
        self.observation: Observation | None = None
        self.guidance: Guidance | None = None
        self._steps = 0

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode. Guide and planner get separate random streams. Raises InputError for another rng."""
        if not isinstance(rng, np.random.Generator):
            raise InputError(f"rng is {rng!r:.80}: must be a generator, such as numpy.random.default_rng(0)")
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
        """Return the guide's explanation of its last decision; None before the first, or if it has none.

        Raises ReturnedError if the guide returns anything else.
        """
        explanation = self.guide.explanation() if isinstance(self.guide, Explainable) else None
        if not isinstance(explanation, Explanation | None):
            raise ReturnedError(
                f"{dotted_name(self.guide)}.explanation returned {explanation!r:.80}: must be an "
                f"{dotted_name(Explanation)}, or None"
            )
        return explanation

    def act(self, observation: Observation, time: float | None = None) -> Twist:
        """Return the velocity command for one control period, within the limits and one ramp of the last command.

        Raises InputError, which names the step, if guide, planner or source of people return invalid values, and if the
        observation cannot be used; it has then changed nothing.
        time: of the scan [s], on any clock; None: one control period after the last one.
        """
        self._steps += 1
        try:
            return self._act(observation, time)
        except ReturnedError as error:
            raise InputError(f"step {self._steps}: {error}") from error

    def _act(self, observation: Observation, time: float | None) -> Twist:
        if self._check:
            observation = self._check.checked(observation)
        elif not math.isfinite(
            sum((*observation.target.tolist(), *observation.twist, *observation.odometry))
        ):
            raise ReturnedError(
                f"the observation has target {observation.target.tolist()}, {observation.twist} and odometry "
                f"{observation.odometry}: must be finite"
            )
        if self.people is not None:
            observation = checked_people(self.people.seen(observation, time), self.people)
        observation = observation._replace(limits=self.cap.of(observation.limits))
        observation = self._feedback.completed(observation)
        self.observation = observation
        if math.hypot(*observation.target.tolist()) < self.goal_tolerance:
            command = Twist(0.0, 0.0)
        else:
            self.guidance = checked_guidance(self.guide.guide(observation), self.guide)
            command = checked_command(self.planner.plan(observation, self.guidance), self.planner)
        return self._feedback.limited(command, observation)


class CommandFeedback:
    """Gives planners the last command and a twist that can be trusted, and keeps commands within the limits.

    A robot that makes less than a fifth of the commanded motion over two seconds counts as held: lifted, blocked or
    stopped by an emergency switch. Commands then ramp from its measured motion, so that it does not leap when
    released.

    A twist that is exactly zero while the pose changes is not a measurement (FAST-LIO publishes such odometry), and
    is replaced by the velocity between the poses.
    """

    def __init__(self, feedback: Feedback | str, dt: float | None) -> None:
        """dt: control period [s]; None: unknown, so acceleration is not limited and the motion is not monitored."""
        if feedback not in list(Feedback):
            raise InputError(f"feedback is {feedback!r}: must be one of {', '.join(Feedback)}")
        self._closed, self._dt = feedback == Feedback.CLOSED_LOOP, dt
        self.reset()

    def reset(self) -> None:
        """Start a new episode, at rest."""
        self._last_command, self._is_warned = _STILL, False
        if self._dt is not None:
            self._reckoning = DeadReckoning(self._dt)
            self._periods: deque[tuple[float, ...]] = deque(maxlen=max(round(_HELD_FOR / self._dt), 1))

    def completed(self, observation: Observation) -> Observation:
        """Fill in the last command, if missing, and what the motion shows. Call it once per period."""
        if observation.last_command is None:
            observation = observation._replace(last_command=self._last_command)
        move = None if self._dt is None else self._reckoning.move(observation)
        is_held = False
        if move is not None:
            velocity = self._reckoning.velocity(move)
            if move.reports_no_speed:
                observation = observation._replace(twist=velocity)
                self._warn(move)
            is_held = self._is_held(observation.last_command or _STILL, velocity)
        return observation._replace(closed_loop=True) if is_held or self._closed else observation

    def limited(self, command: Twist, observation: Observation) -> Twist:
        """Return the command, or the nearest one within the limits, and remember it as the last command."""
        limits = observation.limits
        if self._dt is None:
            self._last_command = limits.clamped(command)
        else:
            self._last_command = reachable(*command, observation.ramp_start, limits, self._dt)
        return self._last_command

    def _is_held(self, command: Twist, velocity: Twist) -> bool:
        assert self._dt is not None
        self._periods.append((*command, *velocity))
        if len(self._periods) < (self._periods.maxlen or 0):
            return False
        sums = (self._dt * sum(column) for column in zip(*self._periods, strict=True))
        commanded_m, commanded_rad, moved_m, moved_rad = sums
        return _behind(commanded_m, moved_m, _MIN_M) or _behind(commanded_rad, moved_rad, _MIN_RAD)

    def _warn(self, move: Move) -> None:
        assert move.pose is not None
        if not self._is_warned and abs(move.pose.x) > _MOVED_M:
            self._is_warned = True
            warnings.warn(
                "the measured twist is always zero, although the robot moves: the velocity is that of the odometry's "
                "poses",
                stacklevel=4,
            )


def _behind(command: float, executed: float, threshold: float) -> bool:
    """Return whether less than a fifth of the commanded motion was executed."""
    return abs(command) > threshold and math.copysign(1.0, command) * executed < _FOLLOWED * abs(command)
