"""Which points of a scan have moved: those in a place through which an earlier scan saw."""

import math

import numpy as np
from numba import njit

from lme.sensing.people.kernels.scans import beam_towards, into

_MISSING_VOTES = 3  # of scans in which a beam without a return is free: surfaces flicker
_FLICKER = 0.1  # share of standing points that were missed before; of a lidar that misses more, no return says nothing
_FADING = 0.98  # share of the counts that is kept from scan to scan


@njit(cache=True, error_model="numpy")
def weigh(points, hits, view, margin, votes):
    """What an earlier scan says of each point (B, 2) with a hit (B,), added to `votes` (B, 2).

    votes: scans that saw through its place, and that did if a beam without a return is free. view: of the earlier
    scan, see `passed_through`.
    """
    lidar, sure, free, angles = view
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for i in range(len(points)):
        if not hits[i]:
            continue
        x, y = into(points[i, 0], points[i, 1], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(free))
        if beam < 0:
            continue
        away = math.sqrt(x * x + y * y)
        if sure[beam] > away + margin:
            votes[i, 0] += 1
        elif free[beam] > away + margin:
            votes[i, 1] += 1


@njit(cache=True, error_model="numpy")
def flickered(votes, stands, counts):
    """Points that stand (B,), and how many of them a beam without a return missed before; `counts` before, fading."""
    standing, missed = _FADING * counts[0], _FADING * counts[1]
    for i in range(len(votes)):
        if stands[i]:
            standing += 1.0
            missed += votes[i, 1] > 0
    return standing, missed


@njit(cache=True, error_model="numpy")
def moved_points(votes, stands, counts):
    """The points (B,) that have moved, by the votes of earlier scans; not where something stood before (B,).

    counts: how many points stand, and were missed before, see `flickered`.
    """
    trusted = counts[1] <= _FLICKER * counts[0]
    moved = np.zeros(len(votes), np.bool_)
    for i in range(len(votes)):
        moved[i] = (votes[i, 0] > 0 or (trusted and votes[i, 1] >= _MISSING_VOTES)) and not stands[i]
    return moved
