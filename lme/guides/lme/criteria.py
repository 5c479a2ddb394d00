"""The six criteria that score a candidate (paper §III.C, Eqs. 2–6 and Algorithm 2).

Each takes (N, 2) candidates in the robot frame and a `View`, and returns (N,) unweighted values; larger is
better. The collision features c are returned as I(c) of Eq. 7, 1 if free and else 0, because all weights are
positive. To add a criterion, write such a function, name it in `guide.criteria` and give a weight of that name.
The first line of each docstring is shown in explainer pages.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.fan import fan_blocked
from lme.guides.lme.surmount import Blockage
from lme.types import Floats

ORIGIN = np.zeros(2)


class View(NamedTuple):
    """Input of the criteria, in the robot frame [m].

    points: (M, 2) scan points sorted by bearing. target: (2,) p_T. radius: r.
    history: (H, 2) recent positions P_his. blockage: the blocking sector, if any. surmount: a key of `SURMOUNT`.
    """

    points: Floats
    target: Floats
    radius: float
    history: Floats
    blockage: Blockage | None
    surmount: str


Criterion = Callable[[Floats, View], Floats]


def a_close(candidates: Floats, view: View) -> Floats:
    """Target proximity: minus the distance from the candidate to the target [m]. Nearer is better.

    Eq. 2.
    """
    return -distances_to(candidates, view.target)


def a_dev(candidates: Floats, view: View) -> Floats:
    """Directional deviation: minus the angle to turn to face the candidate [rad]. Straight ahead is best.

    Eq. 3. The paper's heading is +y and its angle is not wrapped; here the heading is +x and the bearing is in
    (−π, π].
    """
    return -turns(candidates)


def c_o(candidates: Floats, view: View) -> Floats:
    """Collision-free reachability: 1 if the straight way to the candidate is free of obstacles, else 0.

    Eq. 4: free if the segment from the origin to the candidate is at least r away from every scan point.
    """
    return _free(ORIGIN, candidates, view.points, view.radius)


def c_t(candidates: Floats, view: View) -> Floats:
    """Optimistic target reachability: 1 if no obstacle seen blocks the way from the candidate to the target, else 0.

    Eq. 5: free if the segment from the candidate to the target is at least r away from every scan point.
    """
    return _free(view.target, candidates, view.points, view.radius)


def a_mount(candidates: Floats, view: View) -> Floats:
    """Surmount feature: minus the distance to B, past the end of the blocking obstacle [m]; 0 if none blocks.

    Which candidates have it depends on how the paper is read (research/surmount.md): `view.surmount` says which.
    """
    return SURMOUNT[view.surmount](candidates, view)


def a_mount_every(candidates: Floats, view: View) -> Floats:
    """Surmount feature: minus the distance to B [m], past the obstacle between robot and target; 0 if none blocks.

    §III.C(5): "candidate points that are closer to point B are assigned higher surmount values".
    """
    if view.blockage is None:
        return np.zeros(len(candidates))
    return -distances_to(candidates, view.blockage.B)


def a_mount_hidden(candidates: Floats, view: View) -> Floats:
    """Surmount feature: minus the distance to B, past the obstacle's end [m], where it hides the target; else 0.

    Algorithm 2: the obstacle is the blocking sector. It hides the target if one of its points is within r of the
    segment from the candidate to the target.
    """
    if view.blockage is None:
        return np.zeros(len(candidates))
    hidden = fan_blocked(view.target, candidates, view.blockage.points, view.radius)
    return np.where(hidden, a_mount_every(candidates, view), 0.0)


SURMOUNT: Mapping[str, Criterion] = {"every": a_mount_every, "hidden": a_mount_hidden}


def c_h(candidates: Floats, view: View) -> Floats:
    """Historical avoidance: 1 if the straight way to the candidate avoids the robot's recent positions, else 0.

    Eq. 6: free if the segment from the origin to the candidate is at least r away from every recent position.
    """
    return _free(ORIGIN, candidates, view.history, view.radius)


@njit(cache=True)
def _free(apex: Floats, ends: Floats, points: Floats, radius: float) -> Floats:
    """Return 1 if the segment from the apex to the end is at least `radius` away from every point, else 0: (N,)."""
    blocked = fan_blocked(apex, ends, points, radius)
    free = np.empty(len(ends))
    for i in range(len(ends)):
        free[i] = 0.0 if blocked[i] else 1.0
    return free


@njit(cache=True)
def distances_to(points: Floats, target: Floats) -> Floats:
    """Euclidean distance of each of the (N, 2) points to the (2,) target [m]: (N,)."""
    distances = np.empty(len(points))
    for i in range(len(points)):
        dx = points[i, 0] - target[0]
        dy = points[i, 1] - target[1]
        distances[i] = math.sqrt(dx * dx + dy * dy)
    return distances


@njit(cache=True)
def turns(points: Floats) -> Floats:
    """Unsigned angle between +x and each of the (N, 2) points, seen from the origin [rad]: (N,)."""
    angles = np.empty(len(points))
    for i in range(len(points)):
        angles[i] = abs(math.atan2(points[i, 1], points[i, 0]))
    return angles
