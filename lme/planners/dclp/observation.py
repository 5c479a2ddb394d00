"""Observation of DRL-DCLP's network: the nearest return in each of 90 directions, about the robot."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from lme.perception.scan_points import beam_directions
from lme.planners.dclp.kernels.nearest_returns import nearest_returns
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
