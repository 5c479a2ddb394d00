"""Distances and bearings of many points, without temporary arrays."""

import math

import numpy as np
from numba import njit

from lme.types import Floats


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


@njit(cache=True)
def nearest_near_segment(points: Floats, end: Floats, radius: float) -> int:
    """Index of the point nearest to the origin among those within `radius` of the segment origin–end.

    points (M, 2), end (2,) [m]; −1 if no point is nearer than `radius` to the segment.
    """
    best = -1
    best_square = np.inf
    length_square = end[0] * end[0] + end[1] * end[1]
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        square = x * x + y * y
        if square >= best_square:
            continue
        # Nearer than the radius to the start, the end or the inside of the segment, by where the point projects.
        along = x * end[0] + y * end[1]
        if along <= 0.0:
            is_near = square < radius * radius
        elif along >= length_square:
            is_near = (x - end[0]) ** 2 + (y - end[1]) ** 2 < radius * radius
        else:
            is_near = (end[0] * y - end[1] * x) ** 2 < radius * radius * length_square
        if is_near:
            best, best_square = i, square
    return best
