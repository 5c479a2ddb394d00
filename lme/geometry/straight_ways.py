"""Ways that a robot drives by turning in place and then going straight, checked with its exact footprint."""

import math

import numpy as np
from numba import njit

from lme.geometry.arcs import first_contacts
from lme.geometry.fan import fan_blocked
from lme.types import Bools, Floats

KEPT = 0.98  # share of its distance that a point inside the margin keeps
_ROUNDING = 1e-9  # share of a distance that no rounding error reaches


@njit(cache=True, error_model="numpy")
def straight_ways(
    positions: Floats, points: Floats, box: tuple[float, float, float], margin: float, turn_margin: float
) -> Bools:
    """Return whether the robot can turn on the spot to each place and then drive there without contact: (N,).

    positions (N, 2), points (M, 2) in the robot frame [m]; box: footprint (half_length, half_width, rounding) [m]. The
    sides and the front keep `margin` [m] on the straight way, the whole outline keeps `turn_margin` [m] in the turn.
    For a point that is already nearer, it is enough that it comes no nearer.
    """
    # Straight ways, then the turns before them: only points within the turning outline matter there.
    blocked = _blocked_ahead(positions, points, box, margin)
    near_points, _ = _split(points, math.hypot(box[0], box[1]) + box[2] + turn_margin, np.inf)
    if box[0] > 0.0 and len(near_points):
        turns = np.array([[0.0, 1.0], [0.0, -1.0]])
        margins, zeros, full_circles = np.full(2, turn_margin), np.zeros(2), np.full(2, 2.0 * math.pi)
        # At 1 rad/s the times until contact are the greatest free turns [rad].
        left, right = first_contacts(turns, near_points, box, margins, zeros, full_circles, KEPT)
        for n in range(len(positions)):
            bearing = math.atan2(positions[n, 1], positions[n, 0])
            blocked[n] = blocked[n] or bearing > left or -bearing > right
    free: Bools = np.logical_not(blocked)
    return free


@njit(cache=True, error_model="numpy")
def reachable(
    positions: Floats,
    points: Floats,
    box: tuple[float, float, float],
    margin: float,
    turn_margin: float,
    tight: float,
) -> Floats:
    """Rate each place: 1 if the way there is free (`straight_ways`), else 0: (N,).

    If no way is free, both margins are multiplied by `tight`, and the positions that are then free have ½.
    """
    is_free, value = straight_ways(positions, points, box, margin, turn_margin), 1.0
    # No way is free: try narrower margins.
    if not is_free.any():
        is_free, value = straight_ways(positions, points, box, tight * margin, tight * turn_margin), 0.5
    ratings = np.zeros(len(is_free))
    for n in range(len(is_free)):
        if is_free[n]:
            ratings[n] = value
    return ratings


@njit(cache=True, error_model="numpy")
def _blocked_ahead(positions, points, box, margin):
    """Return whether a point is on the straight way to each place, for a robot that faces it: (N,)."""
    width = box[1] + box[2] + margin
    ahead = max(box[0] - box[1], 0.0)  # reach of the front beyond the half disc at the end of the swept strip
    ends, origin = np.empty(positions.shape), np.zeros(2)
    farthest = 0.0
    # Lengthen each way by what the front reaches beyond the disc at its end.
    for n in range(len(positions)):
        distance = math.sqrt(positions[n, 0] * positions[n, 0] + positions[n, 1] * positions[n, 1])
        stretch = 1.0 + ahead / max(distance, 1e-3)
        ends[n, 0], ends[n, 1] = stretch * positions[n, 0], stretch * positions[n, 1]
        farthest = max(farthest, stretch * distance)
    inner, outer = _split(points, width, (1.0 + _ROUNDING) * (farthest + width))
    blocked = fan_blocked(origin, ends, outer, width)
    # Points that are within the width already: none may come nearer than the nearest of them is, but for KEPT.
    if len(inner):
        blocked |= fan_blocked(origin, ends, inner, KEPT * math.sqrt((inner**2).sum(axis=1).min()))
    return blocked


@njit(cache=True, error_model="numpy")
def _split(points, near_limit, far_limit):
    """Split points, in their order, at `near_limit` [m] from the origin; drop those beyond `far_limit` [m]."""
    inner, outer = np.empty(points.shape), np.empty(points.shape)
    i, j = 0, 0
    for n in range(len(points)):
        x, y = points[n, 0], points[n, 1]
        distance = math.sqrt(x * x + y * y)
        # Write each point to both arrays, and advance only where it belongs: no branches.
        inner[i, 0], inner[i, 1] = x, y
        outer[j, 0], outer[j, 1] = x, y
        i += distance < near_limit
        j += near_limit <= distance <= far_limit
    return inner[:i], outer[:j]
