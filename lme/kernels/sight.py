"""Discs in sight of a lidar, with their velocities, as the robot sees them."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def discs_in_sight(
    discs: Floats,
    velocities: Floats,
    ranges: NDArray[np.float32],
    angles: tuple[float, float],
    limits: tuple[float, float, float],
    lidar: tuple[float, float, float],
    base: tuple[float, float, float],
) -> Floats:
    """Positions and velocities in the frame of `base` of the discs that the scan shows: (P, 4) [m, m/s].

    discs (C, 3) [x, y, r] and their velocities (C, 2), in the world; ranges (B,); angles: angle_min and a positive
    angle_increment [rad]; limits: range_min, range_max, slack [m]; lidar, base: poses in the world. A disc is in
    sight if it is within range_max and the beam nearest to its middle does not end more than the slack before it;
    a beam without a return ends nowhere.
    """
    found, count = np.empty((len(discs), 4)), 0
    cos, sin = math.cos(base[2]), math.sin(base[2])
    for i in range(len(discs)):
        dx, dy = discs[i, 0] - lidar[0], discs[i, 1] - lidar[1]
        surface = math.sqrt(dx * dx + dy * dy) - discs[i, 2]
        reach = _range_towards(math.atan2(dy, dx) - lidar[2], ranges, angles)
        hidden = limits[0] <= reach < surface - limits[2]
        if reach == -math.inf or hidden or surface >= limits[1]:
            continue
        x, y, vx, vy = discs[i, 0] - base[0], discs[i, 1] - base[1], velocities[i, 0], velocities[i, 1]
        found[count, 0], found[count, 1] = cos * x + sin * y, cos * y - sin * x
        found[count, 2], found[count, 3] = cos * vx + sin * vy, cos * vy - sin * vx
        count += 1
    seen: Floats = found[:count].copy()
    return seen


@njit(cache=True, error_model="numpy")
def _range_towards(bearing, ranges, angles):
    """Range of the beam nearest to a bearing in the lidar's frame [m]; −∞ outside of the field of view."""
    beam = int(((bearing - angles[0] + 0.5 * angles[1]) % (2.0 * math.pi)) / angles[1])
    return float(ranges[beam]) if beam < len(ranges) else -math.inf
