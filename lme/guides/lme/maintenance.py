"""Keep the old subgoal or switch to the new one (paper §III.D and the second half of Algorithm 1)."""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np
from numba import njit

from lme.geometry.frames import to_robot
from lme.perception.dead_reckoning import Move
from lme.types import Floats, Twist


class Choice(StrEnum):
    """Outcome of one step: the subgoal was kept or switched, and why."""

    FIRST = "first"  # there was no old one
    REACHED = "reached"  # the old one is nearer than d1
    BETTER = "better"  # the new one scores more than d2 higher
    KEPT = "kept"

    @property
    def switched(self) -> bool:
        return self in (Choice.REACHED, Choice.BETTER)


def update_position(points: Floats, previous: Twist, current: Twist, dt: float) -> Floats:
    """Transform fixed points to the robot frame of one control period later: UpdatePos (§III.D).

    points: (N, 2) in the old robot frame [m]. First order, as in the paper: translate by the mean forward
    velocity, then rotate by the mean turn rate.
    """
    return _shift_and_turn(points, *_motion(previous, current, dt))


def carried(points: Floats, move: Move, dt: float) -> Floats:
    """Transform points (N, 2) to the current robot frame: by UpdatePos, or by odometry where that is better."""
    if move.pose is None:
        return update_position(points, move.before, move.now, dt)
    return to_robot(points, move.pose)


def _motion(previous: Twist, current: Twist, dt: float) -> tuple[float, float]:
    """Distance [m] and turn [rad] of one control period, by the mean velocities."""
    return (previous.v + current.v) / 2 * dt, (previous.omega + current.omega) / 2 * dt


@njit(cache=True)
def _shift_and_turn(points: Floats, forward: float, angle: float) -> Floats:
    cos, sin = math.cos(angle), math.sin(angle)
    transformed = np.empty(points.shape)
    for i in range(len(points)):
        x, y = points[i, 0] - forward, points[i, 1]
        transformed[i, 0] = cos * x + sin * y
        transformed[i, 1] = cos * y - sin * x
    return transformed


@njit(cache=True)
def _remember(positions: Floats, length: int, forward: float, angle: float) -> Floats:
    """Append the origin to the (N, 2) positions, keep the last `length`, and transform them by a motion."""
    num_kept = min(len(positions), length - 1)
    recent = np.zeros((num_kept + 1, 2))
    recent[:num_kept] = positions[len(positions) - num_kept :]
    return _shift_and_turn(recent, forward, angle)


@njit(cache=True)
def _at_least(points: Floats, distance: float) -> Floats:
    """Those of the (N, 2) points whose distance from the origin is at least `distance` [m]."""
    distant = np.empty(points.shape)
    count = 0
    for i in range(len(points)):
        if math.hypot(points[i, 0], points[i, 1]) >= distance:
            distant[count, 0], distant[count, 1] = points[i, 0], points[i, 1]
            count += 1
    return distant[:count]


def choose(old_distance: float, old_score: float, new_score: float, d1: float, d2: float) -> Choice:
    """Switch if the old subgoal is reached or scores lower by more than d2 (Algorithm 1, lines 9–13)."""
    if old_distance < d1:
        return Choice.REACHED
    return Choice.BETTER if new_score - old_score > d2 else Choice.KEPT


class History:
    """The robot's last `length` positions, in its current frame (§III.C(6))."""

    def __init__(self, length: int, min_distance: float) -> None:
        """min_distance [m]: nearer positions are ignored, since every path starts among them."""
        self._length = length
        self._min_distance = min_distance
        self._positions = np.empty((0, 2))

    def step(self, move: Move, dt: float) -> None:
        """Add the position of one control period ago and transform all positions to the current frame."""
        if move.pose is None:
            motion = _motion(move.before, move.now, dt)
            self._positions = _remember(self._positions, self._length, *motion)
        else:
            self._positions = to_robot(_remember(self._positions, self._length, 0.0, 0.0), move.pose)

    def points(self) -> Floats:
        """Positions (H, 2) at least `min_distance` away [m], oldest first."""
        return _at_least(self._positions, self._min_distance)
