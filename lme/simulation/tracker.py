"""Tracker of people: positions and velocities of the moving discs that the lidar can see."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.simulation.crowd import Crowd
from lme.types import Floats, LaserScan, Pose

_SLACK = 0.1  # [m] a beam that ends this much before a person is hidden from it; more than a lidar's noise


def tracked(crowd: Crowd, scan: LaserScan, lidar: Pose, base: Pose) -> Floats:
    """Positions and velocities over ground of the people in sight, in the robot frame: (P, 4) [m, m/s].

    People are the crowd's discs; doors and other polygons are not tracked. lidar: where the scan was taken;
    base: the robot; both in the world. A person is in sight if the beam through their middle does not end before
    them. Positions and velocities are the true ones.
    """
    angles = (float(scan.angle_min), float(scan.angle_increment))
    limits = (float(scan.range_min), float(scan.range_max), _SLACK)
    poses = (lidar.x, lidar.y, lidar.yaw), (base.x, base.y, base.yaw)  # Numba takes a Pose for another type
    people: Floats = discs_in_sight(crowd.circles, crowd.disc_velocities, scan.ranges, angles, limits, *poses)
    return people


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
    a beam without a return hides nothing.
    """
    rows, count = np.empty((len(discs), 4)), 0
    cos, sin = math.cos(base[2]), math.sin(base[2])
    for i in range(len(discs)):
        dx, dy = discs[i, 0] - lidar[0], discs[i, 1] - lidar[1]
        # Distance to the near side of the disc, and the range of the beam towards its middle.
        surface = math.sqrt(dx * dx + dy * dy) - discs[i, 2]
        reach = _range_towards(math.atan2(dy, dx) - lidar[2], ranges, angles)
        hidden = limits[0] <= reach < surface - limits[2]
        if reach == -math.inf or hidden or surface >= limits[1]:
            continue
        # Rotate position and velocity into the frame of the base.
        x, y, vx, vy = discs[i, 0] - base[0], discs[i, 1] - base[1], velocities[i, 0], velocities[i, 1]
        rows[count, 0], rows[count, 1] = cos * x + sin * y, cos * y - sin * x
        rows[count, 2], rows[count, 3] = cos * vx + sin * vy, cos * vy - sin * vx
        count += 1
    visible: Floats = rows[:count].copy()
    return visible


@njit(cache=True, error_model="numpy")
def _range_towards(bearing: float, ranges: NDArray[np.float32], angles: tuple[float, float]) -> float:
    """Range of the beam nearest to a bearing in the lidar's frame [m]; −∞ outside the field of view."""
    beam = int(((bearing - angles[0] + 0.5 * angles[1]) % (2.0 * math.pi)) / angles[1])
    return float(ranges[beam]) if beam < len(ranges) else -math.inf
