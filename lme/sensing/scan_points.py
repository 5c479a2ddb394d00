"""What a planar scan says, in the robot frame: the same for every guide and planner."""

from __future__ import annotations

import math
from functools import lru_cache

from lme.kernels.points import beam_directions, scan_points
from lme.types import Floats, LaserScan, Pose


def obstacle_points(scan: LaserScan, mount: Pose) -> Floats:
    """Where the beams hit, in the base frame, sorted by bearing about the base in (−π, π]: (M, 2) [m].

    mount: pose of the lidar in the base frame. Beams that are not finite, below range_min, or at range_max and
    beyond have hit nothing; M may be 0.
    """
    directions = _directions(scan.angle_min, scan.angle_increment, len(scan.ranges))
    return scan_points(scan.ranges, directions, scan.range_min, scan.range_max, mount)


def is_full_circle(scan: LaserScan) -> bool:
    """Whether the last beam's neighbour is the first, to half an increment."""
    return (len(scan.ranges) + 0.5) * abs(scan.angle_increment) >= 2 * math.pi


@lru_cache(maxsize=16)
def _directions(angle_min: float, angle_increment: float, num_beams: int) -> Floats:
    return beam_directions(angle_min, angle_increment, num_beams)
