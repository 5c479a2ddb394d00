"""Keep the old subgoal or switch to the new one (paper §III.D and the second half of Algorithm 1)."""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from lme.types import Floats, Twist


class Choice(StrEnum):
    """What was done with the subgoal, and why."""

    FIRST = "first"  # there was no old one
    REACHED = "reached"  # the old one is nearer than d1
    BETTER = "better"  # the new one scores more than d2 higher
    KEPT = "kept"

    @property
    def switched(self) -> bool:
        return self in (Choice.REACHED, Choice.BETTER)


def update_position(points: Floats, before: Twist, now: Twist, dt: float) -> Floats:
    """UpdatePos (§III.D): where fixed points lie after one control period, seen from the robot.

    points: (..., 2) in the old robot frame [m]. Translates by the mean forward velocity, then turns by the
    mean turn rate: first order, as in the paper.
    """
    angle = (before.omega + now.omega) / 2 * dt
    cos, sin = math.cos(angle), math.sin(angle)
    x = points[..., 0] - (before.v + now.v) / 2 * dt
    y = points[..., 1]
    moved = np.empty_like(points)
    moved[..., 0] = cos * x + sin * y
    moved[..., 1] = cos * y - sin * x
    return moved


def choose(old_distance: float, old_score: float, new_score: float, d1: float, d2: float) -> Choice:
    """Algorithm 1, lines 9–13: switch when the old subgoal is reached or clearly beaten."""
    if old_distance < d1:
        return Choice.REACHED
    return Choice.BETTER if new_score - old_score > d2 else Choice.KEPT


class History:
    """The robot's last `length` positions, in its present frame (§III.C(6))."""

    def __init__(self, length: int, min_distance: float) -> None:
        """min_distance [m]: positions nearer than this do not count; every path starts inside them."""
        self._length = length
        self._min_distance = min_distance
        self._positions = np.empty((0, 2))

    def step(self, before: Twist, now: Twist, dt: float) -> None:
        """Add the position of one control period ago, the old origin, and move all to the present frame."""
        recent = np.concatenate((self._positions, np.zeros((1, 2))))[-self._length :]
        self._positions = update_position(recent, before, now, dt)

    def points(self) -> Floats:
        """(H, 2) positions that count [m], oldest first."""
        square = np.einsum("ij,ij->i", self._positions, self._positions)
        return self._positions[square >= self._min_distance**2]
