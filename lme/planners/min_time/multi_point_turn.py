"""Multi-point turns: strokes forwards, backwards and on the spot, out of a place in which a robot cannot turn."""

from __future__ import annotations

import functools
import itertools
import math
from collections import deque

import numpy as np

from lme.geometry.frames import wrap_angle
from lme.planners.commands import approach
from lme.planners.min_time.kernels.way_out import STROKE, TURN, keeps_on_stroke, poses_after, way_out
from lme.planners.safety.check import STILL
from lme.robots import Footprint
from lme.types import Floats, Limits, Twist

_AFTER = 2.0  # [s] without a free way, after which a turn begins
_CLOSE = 0.4  # share of the margin that is kept
_ROOM = 2.0  # times the margin that the circle around the robot needs to turn on the spot
_SPEED, _MAX_SPEED = 0.25, 0.2  # share of v_max, at most [m/s]
_RATE, _MAX_RATE = 0.5, 0.5  # share of omega_max, at most [rad/s]
_MIN_BACK_SPEED = 0.05  # [m/s] a robot that can only back up more slowly counts as unable to back up
_TOLERANCE = 0.01  # [m, rad] with less than this left, a stroke is over
_RESTS = 0.05  # [m/s, rad/s] below this measured motion the robot counts as standing
_BRAKING = 1.0  # [s] after which it counts as standing, whatever its odometry says
_TIMEOUT, _EXTRA = 5.0, 2.0  # a stroke is given up after this many times its duration, plus [s]
_PATH_INDEX = 1  # index of the place on the fastest way that it drives to if there is no room
_NOWHERE = np.full(2, np.inf)


class MultiPointTurn:
    """Leads a robot without a free way for some time to a place with room to turn on the spot, and turns it there.

    A body that is longer than wide can reach places on arcs that it can leave only by strokes. A search in x, y and
    heading finds a few steps to a place with room (`way_out`), and the strokes are driven one after the other, to the
    end. There the robot turns to the fastest way. If there is no place with room nearby, it drives to a place on the
    fastest way, forwards or backwards, and searches again; it also does so where a point appears on a stroke. A
    stroke that takes far too long, for instance because the robot does not move, ends the turn. With a known delay,
    progress is measured by the commands.
    """

    def __init__(self, footprint: Footprint, dt: float, margin: float) -> None:
        """dt: control period [s]; margin: distance kept to points [m]."""
        self._dt = dt
        self._box = footprint.box
        self._reduced_margin = _CLOSE * margin
        self._room = footprint.circumscribed_radius + _ROOM * margin
        self.reset()
        _load()

    def reset(self) -> None:
        """Forget the strokes, and for how long there was no free way."""
        self._blocked_for = 0.0  # [s] longer than not
        self._previous_twist = STILL
        self._braking = 0.0  # [s] for which it was to stand
        self._strokes: deque[tuple[int, int]] = deque()  # signs of v and ω, one of them 0
        self._lengths: deque[float] = deque()  # of each stroke [m, rad]
        self._time_left = 0.0  # [s] of the first stroke
        self._may_repeat = False  # there is no room at the end of the strokes

    def command(
        self, blocked: bool, points: Floats, path: Floats, twist: Twist, limits: Limits
    ) -> Twist | None:
        """Advance by one period and return the command; None: no turn is under way.

        blocked: the guide finds no free way in this period; points (M, 2): obstacles; path (K, 2): places on the
        fastest way, in the robot frame [m]; twist [m/s, rad/s]. While the robot comes to rest, the command
        is zero.
        """
        self._count(twist, limits)
        # Count the time without a free way; a turn begins after enough of it.
        if not self._strokes:
            self._blocked_for = max(self._blocked_for + (self._dt if blocked else -self._dt), 0.0)
            begins = self._blocked_for > _AFTER
            if not begins and not self._may_repeat:
                return None
        # Stop, and search from standstill, at the beginning and where a stroke is no longer free.
        if not self._strokes or not self._is_free(points):
            if not self._is_at_rest(twist):
                return STILL
            self._plan_strokes(points, path, limits)
        return self._on_stroke(twist, limits) if self._strokes else None

    def _count(self, twist: Twist, limits: Limits) -> None:
        """Subtract the motion of the last period; begin the next stroke once the robot has come to rest."""
        previous, self._previous_twist = self._previous_twist, twist
        if not self._strokes:
            return
        ahead, turn = self._strokes[0]
        driven = ahead * (previous.v + twist.v) + turn * (previous.omega + twist.omega)
        self._lengths[0] -= 0.5 * driven * self._dt
        self._time_left -= self._dt
        if self._lengths[0] < _TOLERANCE and self._is_at_rest(twist):
            self._strokes.popleft()
            self._lengths.popleft()
            self._begin(limits)
        elif self._time_left < 0.0:
            self.reset()

    def _is_at_rest(self, twist: Twist) -> bool:
        """Return whether the robot, which has to stop, is at rest."""
        self._braking += self._dt
        return max(abs(twist.v), abs(twist.omega)) < _RESTS or self._braking > _BRAKING

    def _begin(self, limits: Limits) -> None:
        """Begin the first stroke that is left, if there is one."""
        self._braking = 0.0
        if self._strokes:
            rate = _rates(limits)[0 if self._strokes[0][0] else 1]
            self._time_left = _TIMEOUT * self._lengths[0] / max(rate, _RESTS) + _EXTRA

    def _is_free(self, points: Floats) -> bool:
        """Return whether the rest of the stroke is free."""
        (ahead, turn), remaining = self._strokes[0], max(self._lengths[0], 0.0)
        return bool(
            keeps_on_stroke(points, self._box, self._reduced_margin, ahead * remaining, turn * remaining)
        )

    def _plan_strokes(self, points: Floats, path: Floats, limits: Limits) -> None:
        """Look for strokes from where the robot stands."""
        self.reset()
        goal = path[min(_PATH_INDEX, len(path) - 1)] if len(path) else _NOWHERE
        backwards = limits.lowest <= -_MIN_BACK_SPEED
        steps, room = way_out(points, self._box, self._reduced_margin, self._room, goal, backwards)
        # Join equal steps to strokes.
        for (ahead, turn), run in itertools.groupby(map(tuple, steps.tolist())):
            self._strokes.append((ahead, turn))
            self._lengths.append(len(list(run)) * (STROKE if ahead else TURN))
        self._may_repeat = len(steps) > 0 and not room
        # Where there is room at the end, turn to the fastest way as a last stroke.
        if len(steps) and room and len(path):
            angle = _turn_to(path, poses_after(steps)[-1])
            self._strokes.append((0, 1 if angle > 0.0 else -1))
            self._lengths.append(abs(angle))
        self._begin(limits)

    def _on_stroke(self, twist: Twist, limits: Limits) -> Twist:
        """Return the command on the stroke, so that the robot is at rest at its end."""
        (ahead, turn), (speed, rate) = self._strokes[0], _rates(limits)
        length = self._lengths[0] if self._lengths[0] > _TOLERANCE else 0.0  # an overshoot is not driven back
        v = approach(ahead * length, twist.v, speed, limits.alpha_v, self._dt)
        return Twist(v, approach(turn * length, twist.omega, rate, limits.alpha_omega, self._dt))


@functools.cache
def _load() -> None:
    """Load the compiled search once per process, so that a robot that is stuck need not wait for it."""
    point, box = np.array([[0.4, 0.0]]), (0.3, 0.2, 0.0)
    way_out(point, box, 0.02, 0.41, _NOWHERE, True)
    keeps_on_stroke(point, box, 0.02, STROKE, 0.0)


def _rates(limits: Limits) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] on strokes; the planner limits both by what the robot can do."""
    return min(_SPEED * limits.v_max, _MAX_SPEED), min(_RATE * limits.omega_max, _MAX_RATE)


def _turn_to(path: Floats, pose: Floats) -> float:
    """Angle by which a robot at the pose (3,) has to turn to face along the path (K, 2) [rad]."""
    nearest = int(np.hypot(*(path - pose[:2]).T).argmin())
    x, y = path[min(nearest + 1, len(path) - 1)] - pose[:2]
    return wrap_angle(math.atan2(y, x) - float(pose[2]))
