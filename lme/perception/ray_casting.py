"""Scans of obstacles that are given as shapes, for simulators that have no lidar of their own."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lme.geometry.frames import compose
from lme.perception import raycast
from lme.robots import Lidar
from lme.types import Floats, LaserScan, Pose


def cast(lidar: Lidar, pose: Pose, circles: ArrayLike = (), segments: ArrayLike = ()) -> LaserScan:
    """Return the scan, without noise, of a planar lidar on a robot at `pose`.

    pose: of the robot in the world. circles: (C, 3) solid discs [x, y, radius] [m]. segments: (S, 4) thin walls
    [x0, y0, x1, y1] [m], in the world. Inside a disc all ranges are 0. Raises ValueError for other shapes.
    """
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    lidar_pose = compose(pose, lidar.mount)
    ranges = raycast.cast(lidar_pose, angles, lidar.range_max, _rows(circles, 3), _rows(segments, 4))
    return LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)


def _rows(values: ArrayLike, columns: int) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1, columns)
