"""Projection of a point cloud to the bins of a planar scan."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def nearest_per_bin(
    points: Floats,
    transform: Floats,
    heights: tuple[float, float],
    angles: tuple[float, float, float, int],
    spans: tuple[float, float],
    empty: float,
) -> NDArray[np.float32]:
    """Least horizontal range of the points in each bin, `empty` for a bin without points: (B,) [m].

    points (N, 3) [m]; transform (4, 4) from their frame to the scan's; heights (lowest, highest) and spans
    (nearest, farthest): limits of the points that count, inclusive [m]; angles (first, last, increment, B) [rad].
    Bin i covers bearings from first + i · increment up to the next; the last bin also takes bearings that are
    rounded beyond it. Points that are not finite are ignored.
    """
    ranges = np.full(angles[3], np.float32(empty))
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        up = transform[2, 0] * x + transform[2, 1] * y + transform[2, 2] * z + transform[2, 3]
        if not (heights[0] <= up <= heights[1]):  # also drops NaN
            continue
        ahead = transform[0, 0] * x + transform[0, 1] * y + transform[0, 2] * z + transform[0, 3]
        left = transform[1, 0] * x + transform[1, 1] * y + transform[1, 2] * z + transform[1, 3]
        distance = math.hypot(ahead, left)
        if not (spans[0] <= distance <= spans[1]):  # also drops NaN
            continue
        bearing = math.atan2(left, ahead)
        if angles[0] <= bearing <= angles[1]:
            i = min(int((bearing - angles[0]) / angles[2]), len(ranges) - 1)
            ranges[i] = min(ranges[i], np.float32(distance))
    return ranges
