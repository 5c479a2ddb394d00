"""Runs of neighbouring scan points that may be somebody."""

import math

import numpy as np
from numba import njit

from lme.sensing.people.kernels.middle import gap_at

FEWEST = 2  # points of a run
_LEG_WIDTH = 0.3  # [m] widest run that may be a leg


@njit(cache=True, error_model="numpy")
def runs_of(points, free_points, moved, lidar, settings):
    """The group of each point, −1 for none, and the number of groups.

    points (B, 2), moved (B,); free_points (B,): hits that belong to no track. A group is a run that is not wider than
    a person, or the part of a wider one that has moved; two legs that have moved are one group.
    """
    count = len(points)
    group = np.full(count, -1, np.int64)
    found, start = 0, -1
    first, last = np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count + 1):
        ends = i == count or not free_points[i]
        if start >= 0 and (ends or apart(points, i - 1, i, lidar)):
            found = _add(points, moved, (start, i), first, last, found, settings)
            start = -1
        if not ends and start < 0:
            start = i
    groups = 0
    for n in range(found):
        joined = _leg_before(points, moved, first, last, n, group, settings)
        own = joined if joined >= 0 else groups
        groups += joined < 0
        for i in range(first[n], last[n]):
            group[i] = own
    return group, groups


@njit(cache=True, error_model="numpy", inline="always")
def apart(points, i, j, lidar):
    """Whether neighbouring points do not belong together."""
    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
    away = math.sqrt((points[j, 0] - lidar[0]) ** 2 + (points[j, 1] - lidar[1]) ** 2)
    return math.sqrt(dx * dx + dy * dy) > gap_at(away)


@njit(cache=True, error_model="numpy")
def _add(points, moved, run, first, last, found, settings):
    """Add a run of points, or its moved parts if it is too wide."""
    start, end = run
    if end - start < FEWEST:
        return found
    if _width(points, start, end) <= settings.widest:
        first[found], last[found] = start, end
        return found + 1
    begun = -1
    for i in range(start, end + 1):
        goes_on = i < end and moved[i]
        if goes_on and begun < 0:
            begun = i
        if not goes_on and begun >= 0:
            if i - begun >= FEWEST and _width(points, begun, i) <= settings.widest:
                first[found], last[found] = begun, i
                found += 1
            begun = -1
    return found


@njit(cache=True, error_model="numpy")
def _width(points, start, end):
    """The diagonal of the box around points [m]."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for i in range(start, end):
        low_x, high_x = min(low_x, points[i, 0]), max(high_x, points[i, 0])
        low_y, high_y = min(low_y, points[i, 1]), max(high_y, points[i, 1])
    return math.sqrt((high_x - low_x) ** 2 + (high_y - low_y) ** 2)


@njit(cache=True, error_model="numpy")
def _leg_before(points, moved, first, last, n, group, settings):
    """The group of an earlier leg beside this one; −1: this is not a leg, or it is alone."""
    if not _is_leg(points, moved, first[n], last[n]):
        return -1
    x, y = _mean(points, first[n], last[n])
    for m in range(n - 1, max(n - 5, -1), -1):
        if _is_leg(points, moved, first[m], last[m]):
            other_x, other_y = _mean(points, first[m], last[m])
            if math.sqrt((x - other_x) ** 2 + (y - other_y) ** 2) < settings.joint:
                return group[first[m]]
    return -1


@njit(cache=True, error_model="numpy")
def _is_leg(points, moved, start, end):
    return 2 * moved[start:end].sum() >= end - start and _width(points, start, end) <= _LEG_WIDTH


@njit(cache=True, error_model="numpy")
def _mean(points, start, end):
    x = y = 0.0
    for i in range(start, end):
        x, y = x + points[i, 0], y + points[i, 1]
    return x / (end - start), y / (end - start)
