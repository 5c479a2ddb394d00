"""The obstacle that blocks the path to the target, and a point for passing it (paper Algorithm 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.guides.lme.distance import nearest_near_segment
from lme.guides.lme.kernels import cluster
from lme.types import Floats, Ints

RULES = ("corridor", "line_of_sight")


class Blockage(NamedTuple):
    """The blocking sector and the point for passing it.

    points: (P, 2) the sector's scan points, counter-clockwise. E1, E2: (2,) its ends. A: the end nearer in
    angle to the target. B: (2,) the point r beyond A on the ray OA. All in the robot frame [m].
    """

    points: Floats
    E1: Floats
    E2: Floats
    A: Floats
    B: Floats


def find_blockage(
    points: Floats, target: Floats, radius: float, full_circle: bool, rule: str
) -> Blockage | None:
    """Find the sector between robot and target; None if there is none, or if the sectors form a closed ring.

    points: (M, 2) scan points sorted by bearing; target: (2,); radius: r [m].
    rule "corridor": the sector of the nearest scan point within r of the segment O–T;
    "line_of_sight": the sector that the ray towards T hits before T. A closed ring has no ends to pass.
    """
    blocking_point = nearest_near_segment if rule == "corridor" else _point_on_ray
    owner = int(blocking_point(points, target, radius))
    if owner < 0:
        return None
    sector, closed = _sector_of(points, owner, 2.0 * radius, full_circle)
    if closed:
        return None
    blocking = sector_points(points, sector)
    first_is_nearer, B = _past_the_end(blocking, target, radius)
    return Blockage(blocking, blocking[0], blocking[-1], blocking[0] if first_is_nearer else blocking[-1], B)


@njit(cache=True)
def _sector_of(points: Floats, index: int, gap: float, full_circle: bool) -> tuple[tuple[int, int], bool]:
    """Sector (first, last) that contains scan point `index`, and whether the sectors form a closed ring."""
    sectors, closed = cluster(points, gap, full_circle)
    first, last = 0, len(points) - 1
    for k in range(len(sectors)):
        first, last = sectors[k, 0], sectors[k, 1]
        if first <= index <= last or (first > last and (index >= first or index <= last)):
            break
    return (first, last), closed


@njit(cache=True)
def _past_the_end(sector: Floats, target: Floats, radius: float) -> tuple[bool, Floats]:
    """Return whether A is the first, not the last, of the sector's points (P, 2), and B, `radius` beyond A on OA."""
    first_is_nearer = _angle_between(sector[0], target) <= _angle_between(sector[-1], target)
    A = sector[0] if first_is_nearer else sector[-1]
    return first_is_nearer, A * (1.0 + radius / math.hypot(A[0], A[1]))


def sector_points(points: Floats, sector: Sequence[int] | Ints) -> Floats:
    """Scan points of one sector [first, last], counter-clockwise, also across ±π: (P, 2)."""
    first, last = sector
    if first <= last:
        return points[first : last + 1]
    return np.concatenate((points[first:], points[: last + 1]))


def _point_on_ray(points: Floats, target: Floats, radius: float) -> int:
    """Index of the scan point nearest in angle to the target, if it is on the ray and before the target; else −1."""
    if len(points) == 0:
        return -1
    ahead = points @ target > 0.0
    across = np.abs(points[:, 0] * target[1] - points[:, 1] * target[0])
    distance = np.hypot(points[:, 0], points[:, 1])
    angle = np.where(ahead, across / np.maximum(distance, 1e-12), np.inf)
    index = int(np.argmin(angle))
    off_ray = angle[index] / max(math.hypot(target[0], target[1]), 1e-12)
    hit = off_ray * distance[index] < radius and distance[index] < math.hypot(target[0], target[1])
    return index if hit else -1


@njit(cache=True)
def _angle_between(a: Floats, b: Floats) -> float:
    """Unsigned angle ∠aOb [rad]."""
    return abs(math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]))
