"""Motion that a navigator's commands have led to, and the twist from which the next command ramps."""

from __future__ import annotations

import math
import warnings
from collections import deque

from lme.errors import InputError
from lme.perception.dead_reckoning import DeadReckoning, Move
from lme.robots import reachable
from lme.types import Feedback, Observation, Twist

_STILL = Twist(0.0, 0.0)
_HELD_FOR = 2.0  # [s]
_MIN_M, _MIN_RAD = 0.1, 0.2  # less commanded motion over that time is inconclusive
_FOLLOWED = 0.2  # share of the commanded motion
_MOVED_M = 0.02  # in a control period: more than the noise of the odometry


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
