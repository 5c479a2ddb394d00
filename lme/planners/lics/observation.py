"""Observation of the LiCS network: 720 beams over 270°, and the direction of a point on the path."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lme.planners.lics.weights import BEAMS
from lme.types import Floats, LaserScan

FRONT = slice(253, 467)  # beams within 40° of straight ahead, as the authors choose them
_BEARINGS = np.radians(np.linspace(-135.0, 135.0, BEAMS))
_AT_ROBOT = 0.05  # [m] a path that begins nearer than this begins at the robot


def sweep(scan: LaserScan, mount_yaw: float, clip: float) -> NDArray[np.float32]:
    """Range of the nearest beam in each of the 720 directions, from the right to the left: (720,) [m].

    mount_yaw: of the lidar in the base frame [rad]. A beam without a return, a direction without a beam, and a range
    above `clip` give `clip`.
    """
    ranges = np.full(BEAMS, clip, np.float32)
    if len(scan.ranges) == 0 or scan.angle_increment == 0.0:
        return ranges
    step, first = scan.angle_increment, scan.angle_min + mount_yaw
    turned = (_BEARINGS - first) * math.copysign(1.0, step)  # from the first beam on
    beams = np.rint((turned + abs(step) / 2.0) % math.tau / abs(step) - 0.5).astype(np.int64)
    seen = beams < len(scan.ranges)
    found = scan.ranges[np.where(seen, beams, 0)]
    with np.errstate(invalid="ignore"):
        seen &= (found >= scan.range_min) & (found < scan.range_max)
    ranges[seen] = np.minimum(found[seen], np.float32(clip))
    return ranges


def direction_along(path: Floats, los: float) -> Floats:
    """Unit vector (2,) to the first point of a path (K, 2) [m] that is farther than `los` [m] from its start.

    The start is the robot if the path begins there. Without such a point the last one is used; (0, 0) if the path
    ends where it begins. The authors smooth the path first; ours is made of straight pieces and does not need it.
    """
    begin = path[0] if math.hypot(*path[0]) > _AT_ROBOT else np.zeros(2)
    away = path - begin
    far = np.flatnonzero(np.hypot(away[:, 0], away[:, 1]) > los)
    towards = away[far[0] if len(far) else -1]
    length = math.hypot(*towards)
    return towards / length if length > 0.0 else np.zeros(2)
