"""A scan as points and as free space, and what earlier scans say about a place."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.kernels.bearing import bearing
from lme.types import Bools, Floats, Ints

_TAU = 2.0 * math.pi


class NewestScan(NamedTuple):
    """The newest scan, for kernels: a row per beam.

    points (B, 2): in the tracker's frame; hits (B,): whether the beam returned; moved (B,): whether the place was
    empty before; stands (B,): whether something stood there before; owner (B,): name of the track, −1 for none.
    movers (N,): whether the track of a name, modulo N, has been confirmed.
    """

    points: Floats
    hits: Bools
    moved: Bools
    stands: Bools
    owner: Ints
    movers: Bools


@njit(cache=True, error_model="numpy")
def unpacked(ranges, directions, limits, missing, guard_beams):
    """What a scan shows: points (B, 2) in the lidar's frame, hits (B,), and free ranges (B,) and (B,) [m].

    A free range is the least one of the beams up to `guard_beams` aside. A beam without a return is free up to
    `missing` [m] in the second ones, and not at all in the first. A beam that failed (NaN) is never free.
    directions (B, 2); limits: range_min, range_max [m].
    """
    count = len(ranges)
    points, hits, reach = np.empty((count, 2)), np.zeros(count, np.bool_), np.empty(count)
    for i in range(count):
        seen = float(ranges[i])
        hits[i] = limits[0] <= seen < limits[1]
        reach[i] = seen if hits[i] else 0.0 if math.isnan(seen) else missing
        points[i, 0], points[i, 1] = reach[i] * directions[i, 0], reach[i] * directions[i, 1]
    sure, free = np.empty(count), np.empty(count)
    for i in range(count):
        least, all_hit = reach[i], True
        for j in range(max(i - guard_beams, 0), min(i + guard_beams + 1, count)):
            least, all_hit = min(least, reach[j]), all_hit and hits[j]
        free[i] = least
        sure[i] = least if all_hit else 0.0
    return points, hits, sure, free


@njit(cache=True, error_model="numpy", inline="always")
def beam_towards(x, y, angles, count):
    """The beam nearest to a place in the lidar's frame; −1 outside the field of view. angles: first, step [rad]."""
    turn = (bearing(x, y) - angles[0] + 0.5 * angles[1]) / _TAU
    beam = int((turn - math.floor(turn)) * _TAU / angles[1])
    return beam if beam < count else -1


@njit(cache=True, error_model="numpy", inline="always")
def into(x, y, pose, cos, sin):
    """A place of the parent frame in the frame at `pose`; cos, sin: of its yaw."""
    dx, dy = x - pose[0], y - pose[1]
    return cos * dx + sin * dy, cos * dy - sin * dx


@njit(cache=True, error_model="numpy")
def passed_through(places, view, margin):
    """Whether a scan saw through each place (P, 2) [m]: 1 yes, −1 no, 0 not known, for it lies behind something.

    view: the scan's pose in the frame of the places, its free ranges (B,) and (B,), see `unpacked`, and the beams'
    first angle and step [rad]. Yes: the beam ends `margin` [m] behind the place. No: it ends near it.
    """
    lidar, sure, free, angles = view
    said = np.zeros(len(places), np.int8)
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for i in range(len(places)):
        x, y = into(places[i, 0], places[i, 1], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(free))
        if beam < 0:
            continue
        away = math.sqrt(x * x + y * y)
        if sure[beam] > away + margin:
            said[i] = 1
        elif abs(free[beam] - away) <= 2.0 * margin:
            said[i] = -1
    return said
