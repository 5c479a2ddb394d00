"""Observation of DRL-DCLP's network: the nearest return in each of 90 directions, about the robot."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.perception.scan_points import beam_directions
from lme.planners.dclp.weights import DIRECTIONS
from lme.types import Floats, Ints, LaserScan, Pose

_SECTOR = math.tau / DIRECTIONS
_RIGHT = -math.pi / 2  # [rad] bearing of the first direction; the network's x is to the right, its y ahead
_EDGE = 1e-6  # [rad] a beam on the edge of two sectors belongs to the second one, whatever the rounding


def nearest_by_direction(scan: LaserScan, mount: Pose, no_return: float, blind_range: float) -> Floats:
    """Direction and distance of the nearest return in every 4° about the lidar: (90, 3) of cos, sin and [m].

    Direction and distance are those from the base, in the network's frame: x to the right, y ahead.
    no_return: range of a beam without return [m]. blind_range: range in a direction without beams [m].
    """
    sectors, directions = _beams(scan.angle_min + mount.yaw, scan.angle_increment, len(scan.ranges))
    limits = (float(scan.range_min), float(scan.range_max), float(no_return))
    offset = (-float(mount.y), float(mount.x))
    return nearest_returns(scan.ranges, sectors, directions, limits, blind_range * _middles(), offset)


@lru_cache(maxsize=16)
def _beams(angle_min: float, angle_increment: float, num_beams: int) -> tuple[Ints, Floats]:
    """Sectors (B,) of the beams and their directions (B, 2) in the network's frame."""
    angles = angle_min + angle_increment * np.arange(num_beams) - _RIGHT
    sectors = np.floor((angles + _EDGE) / _SECTOR).astype(np.int64) % DIRECTIONS
    return sectors, beam_directions(angle_min - _RIGHT, angle_increment, num_beams)


@lru_cache(maxsize=1)
def _middles() -> Floats:
    """Directions of the sectors' middles: (90, 2)."""
    return beam_directions(_SECTOR / 2, _SECTOR, DIRECTIONS)


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
    # Move the origin from the lidar to the base, and give each point as direction and distance.
    seen = np.zeros((len(points), 3))
    for s in range(len(points)):
        x, y = points[s, 0] + offset[0], points[s, 1] + offset[1]
        distance = math.hypot(x, y)
        seen[s, 2] = distance
        if distance > 0.0:
            seen[s, 0], seen[s, 1] = x / distance, y / distance
    return seen
