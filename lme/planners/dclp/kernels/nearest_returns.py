"""Nearest return of a scan in each sector."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats, Ints


@njit(cache=True, error_model="numpy")
def nearest_returns(
    ranges: NDArray[np.float32],
    sectors: Ints,
    directions: Floats,
    limits: tuple[float, float, float],
    unseen: Floats,
    offset: tuple[float, float],
) -> Floats:
    """Direction and distance of the nearest return in each of S sectors, about the base: (S, 3) of cos, sin, [m].

    ranges (B,); sectors (B,) of the beams, and their directions (B, 2) about the lidar, in any frame of angles.
    limits: range_min, range_max, and the range that replaces one outside them or NaN [m]. unseen (S, 2):
    the point about the lidar of a sector without beams [m]. offset: of the lidar from the base [m]. Of equal
    ranges, the beam that is first counter-clockwise counts.
    """
    lowest, highest = np.float32(limits[0]), np.float32(limits[1])
    best = np.full(len(unseen), math.inf)
    points = unseen.copy()
    for i in range(len(ranges)):
        s, reach = sectors[i], limits[2]
        if lowest <= ranges[i] < highest:  # also drops NaN
            reach = float(ranges[i])
        # Point of this beam, and whether it replaces the nearest one of its sector so far.
        x, y = reach * directions[i, 0], reach * directions[i, 1]
        before = points[s, 0] * y - points[s, 1] * x > 0.0  # the current nearest comes before this beam
        if reach < best[s] or (reach == best[s] and not before):
            best[s] = reach
            points[s, 0], points[s, 1] = x, y
    # Move the origin from the lidar to the base.
    seen: Floats = _about_base(points, offset)
    return seen


@njit(cache=True, error_model="numpy")
def _about_base(points, offset):
    """Directions and distances (S, 3) of points (S, 2) about the lidar."""
    out = np.empty((len(points), 3))
    for s in range(len(points)):
        x, y = points[s, 0] + offset[0], points[s, 1] + offset[1]
        distance = math.hypot(x, y)
        out[s, 0], out[s, 1], out[s, 2] = 0.0, 0.0, distance
        if distance > 0.0:
            out[s, 0], out[s, 1] = x / distance, y / distance
    return out
