"""Multi-point turns: strokes forwards, back and on the spot that lead out of a place in which a robot cannot turn."""

from __future__ import annotations

import itertools
import math
from collections import deque

import numpy as np

from lme.kernels.way_out import STROKE, TURN, keeps_on_stroke, poses_after, way_out
from lme.planners.commands import approach
from lme.robots import Footprint
from lme.types import Floats, Limits, Twist

_CLOSE = 0.4  # share of the margin that is kept
_ROOM = 2.0  # times the margin that the circle around the robot needs to turn on the spot
_SPEED, _MOST_SPEED = 0.25, 0.2  # share of v_max, at most [m/s]
_RATE, _MOST_RATE = 0.5, 0.5  # share of omega_max, at most [rad/s]
_DONE = 0.005  # [m, rad] with less than this left, a stroke is over
_AT_REST = 0.02  # [m/s, rad/s] slower than this the robot rests, as far as its odometry tells
_NOWHERE = np.full(2, np.inf)
_ALONG = 1  # which place on the way it goes to where there is no room


class MultiPointTurn:
    """Leads a robot that has had no free way for some time to a place in which it can turn on the spot, and turns it.

    A body that is longer than wide gets by arcs into places that it can leave only by strokes. A search in x, y and
    heading finds the fewest steps to a place with room (`way_out`), and the strokes are driven one after the other.
    There the robot turns to the fastest way on. Without a place with room near it, it goes back along the fastest way
    until there is one. A new search is made where a point turns up on a stroke.
    """

    def __init__(self, footprint: Footprint, dt: float, after: float, margin: float) -> None:
        """after: for how long there is no free way [s], 0: never; margin: to obstacle points [m]."""
        self._dt = dt
        self._after = after
        self._box = footprint.box
        self._close = _CLOSE * margin
        self._room = footprint.r_max + _ROOM * margin
        self.reset()

    def reset(self) -> None:
        """Forget for how long there was no free way, and the strokes."""
        self._blocked_for = 0.0  # [s] longer than not
        self._before = Twist(0.0, 0.0)
        self._strokes: deque[tuple[int, int]] = deque()  # signs of v and ω, one of them 0
        self._left: deque[float] = deque()  # of each stroke [m, rad]
        self._goes_on = False  # there is no room at the end of the strokes

    def command(self, blocked: bool, points: Floats, way: Floats, now: Twist, limits: Limits) -> Twist | None:
        """Advance one period, in which the guide found no free way or did; None: no turn is under way.

        points (M, 2): obstacles; way (K, 2): places on the fastest way, in the robot frame [m]; now: the twist.
        """
        self._count(now)
        if not self._strokes:
            self._blocked_for = max(self._blocked_for + (self._dt if blocked else -self._dt), 0.0)
            if not self._goes_on and not self._blocked_for > self._after > 0.0:
                return None
        if not self._strokes or not self._is_free(points):
            if not _rests(now):
                return Twist(0.0, 0.0)
            self._find(points, way, limits)
        return self._along(now, limits) if self._strokes else None

    def _count(self, now: Twist) -> None:
        """Subtract what was driven in the last period; the next stroke begins when the robot has come to rest."""
        before, self._before = self._before, now
        if self._strokes:
            ahead, turn = self._strokes[0]
            driven = ahead * (before.v + now.v) + turn * (before.omega + now.omega)
            self._left[0] -= 0.5 * driven * self._dt
            if self._left[0] < _DONE and _rests(now):
                self._strokes.popleft()
                self._left.popleft()

    def _is_free(self, points: Floats) -> bool:
        """Whether what is left of the stroke is free."""
        (ahead, turn), left = self._strokes[0], max(self._left[0], 0.0)
        return bool(keeps_on_stroke(points, self._box, self._close, ahead * left, turn * left))

    def _find(self, points: Floats, way: Floats, limits: Limits) -> None:
        """Look for strokes from where the robot stands."""
        self.reset()
        along = way[min(_ALONG, len(way) - 1)] if len(way) else _NOWHERE
        steps, room = way_out(points, self._box, self._close, self._room, along, limits.lowest < 0.0)
        for (ahead, turn), same in itertools.groupby(map(tuple, steps.tolist())):
            self._strokes.append((ahead, turn))
            self._left.append(len(list(same)) * (STROKE if ahead else TURN))
        self._goes_on = len(steps) > 0 and not room
        if len(steps) and room and len(way):
            angle = _turn_to(way, poses_after(steps)[-1])
            self._strokes.append((0, 1 if angle > 0.0 else -1))
            self._left.append(abs(angle))

    def _along(self, now: Twist, limits: Limits) -> Twist:
        """The command on the stroke, so that the robot stands at its end."""
        (ahead, turn), left = self._strokes[0], self._left[0]
        left = left if left > _DONE else 0.0  # who has overshot does not come back
        speed, rate = min(_SPEED * limits.v_max, _MOST_SPEED), min(_RATE * limits.omega_max, _MOST_RATE)
        speed = min(speed, -limits.lowest) if ahead < 0 else speed
        v = approach(ahead * left, now.v, speed, limits.alpha_v, self._dt)
        omega = approach(turn * left, now.omega, rate, limits.alpha_omega, self._dt)
        return Twist(v, omega)


def _turn_to(way: Floats, pose: Floats) -> float:
    """How far a robot at the pose (3,) has to turn to look along the way (K, 2) [rad]."""
    nearest = int(np.hypot(*(way - pose[:2]).T).argmin())
    x, y = way[min(nearest + 1, len(way) - 1)] - pose[:2]
    return math.remainder(math.atan2(y, x) - pose[2], 2.0 * math.pi)


def _rests(now: Twist) -> bool:
    return max(abs(now.v), abs(now.omega)) < _AT_REST
