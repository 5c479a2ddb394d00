"""Obstacle points of a planar scan in the robot frame, shared by all guides and planners."""

from __future__ import annotations

import math
from functools import lru_cache

from lme.geometry.points import beam_directions, scan_points
from lme.types import Floats, LaserScan, Pose


def obstacle_points(scan: LaserScan, mount: Pose) -> Floats:
    """Points hit by the beams, in the base frame, sorted by bearing about the base in (−π, π]: (M, 2) [m].

    mount: pose of the lidar in the base frame. A range that is not finite, below range_min or ≥ range_max is not
    a hit; M may be 0.
    """
    directions = _directions(scan.angle_min, scan.angle_increment, len(scan.ranges))
    # A plain tuple: Numba takes a named one for another type, and needs longer to recognise it.
    return scan_points(scan.ranges, directions, scan.range_min, scan.range_max, (*mount,))


def is_full_circle(scan: LaserScan) -> bool:
    """Return whether the first beam follows the last one after one increment, to within half an increment."""
    return (len(scan.ranges) + 0.5) * abs(scan.angle_increment) >= 2 * math.pi


@lru_cache(maxsize=16)
def _directions(angle_min: float, angle_increment: float, num_beams: int) -> Floats:
    return beam_directions(angle_min, angle_increment, num_beams)
