"""Projection of a 3D point cloud to a planar scan.

The conventions are those of the ROS package `pointcloud_to_laserscan`, so its parameters carry over unchanged.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError, require
from lme.perception.point_cloud import rigid_transform
from lme.types import Floats, LaserScan

_MOST_BEAMS = 100_000
_ROUNDING = 1e-6  # for π written with six digits or as float32
CLEARED = 3.0  # [m] ASSUMED: a level Mid-360, .45 m high, sees the floor from 3.7 m on


@dataclass(slots=True)
class Projection:
    """Selection and binning of points; names and defaults of ROS 2 `pointcloud_to_laserscan`.

    Heights are in the frame of the scan. The default of min_height is the smallest positive number, as in ROS:
    points at or below the height of the frame's origin are dropped.
    """

    min_height: float = sys.float_info.min  # [m]
    max_height: float = math.inf  # [m]
    angle_min: float = -math.pi  # [rad]
    angle_max: float = math.pi  # [rad]
    angle_increment: float = math.pi / 180  # [rad]
    range_min: float = 0.0  # [m] nearer points are dropped
    range_max: float = math.inf  # [m] farther points are dropped
    use_inf: bool = True  # a bin without a point reads inf, else range_max + inf_epsilon
    inf_epsilon: float = 1.0  # [m]

    def __post_init__(self) -> None:
        require("projection.angle_min", self.angle_min, at_least=-math.pi - _ROUNDING)
        require("projection.angle_max", self.angle_max, above=self.angle_min, at_most=math.pi + _ROUNDING)
        span = self.angle_max - self.angle_min
        require("projection.angle_increment", self.angle_increment, above=0.0, at_most=span)
        require("projection.angle_increment", self.angle_increment, at_least=span / _MOST_BEAMS)
        require("projection.range_min", self.range_min, at_least=0.0)
        if not self.range_max > self.range_min:
            raise InputError(
                f"projection.range_max is {self.range_max:g}: must be greater than range_min {self.range_min:g}"
            )
        if not self.min_height <= self.max_height:
            raise InputError(
                f"projection.min_height is {self.min_height:g} and max_height {self.max_height:g}: must be two "
                "heights [m], the first not above the second"
            )
        if not self.use_inf:
            require("projection.range_max (with use_inf false)", self.range_max)
            require("projection.inf_epsilon", self.inf_epsilon, at_least=0.0)

    @property
    def num_beams(self) -> int:
        """Bins from angle_min to angle_max, counted in float32 as in ROS: ±1.57 by 0.01 are 315, not 314."""
        first, last = np.float32(self.angle_min), np.float32(self.angle_max)
        return math.ceil((last - first) / np.float32(self.angle_increment))


def to_scan(points: ArrayLike, projection: Projection, mount: ArrayLike = (0, 0, 0, 0, 0, 0)) -> LaserScan:
    """Project a cloud to a scan: each bin gets the point at the least horizontal range.

    points: (N, 3) [m] in the sensor's frame; mount: see `rigid_transform`. The scan and its heights are in the
    base frame. A beam's bin starts at its bearing and ends at the next one's, as in ROS; in other scans the
    bearing is the middle of the bin. Raises InputError for points or mounts of another shape.
    """
    cloud = np.ascontiguousarray(points, dtype=np.float64)
    if cloud.ndim != 2 or cloud.shape[1] != 3:
        raise InputError(
            f"points have shape {cloud.shape}: must be (N, 3), one row x, y, z [m] for each point"
        )
    p = projection
    ranges: NDArray[np.float32] = nearest_per_bin(
        cloud,
        np.ascontiguousarray(rigid_transform(mount)),
        (float(p.min_height), float(p.max_height)),
        (float(p.angle_min), float(p.angle_max), float(p.angle_increment), p.num_beams),
        (float(p.range_min), float(p.range_max)),
        math.inf if p.use_inf else p.range_max + p.inf_epsilon,
    )
    return LaserScan(ranges, p.angle_min, p.angle_increment, p.range_min, p.range_max)


def without_unmeasured(scan: LaserScan, points: Floats, sensor: Floats, projection: Projection) -> LaserScan:
    """Replace the inf of a bin that the cloud says nothing about by NaN, as REP-117 has it for a failed measurement.

    A lidar that tilts, or whose pattern is sparse, sends no ray between the two heights in some directions, and a near
    wall then leaves no point there. Such a bin is not free. It is free if the ray to another point, such as one on
    the floor, is between the heights for at least `CLEARED` from the sensor. scan: of `to_scan` with `use_inf`.
    points (N, 3) and sensor (3,): in the frame of the scan [m].
    """
    heights = float(projection.min_height), float(projection.max_height)
    angles = float(projection.angle_min), float(projection.angle_increment), projection.num_beams
    cleared = cleared_per_bin(np.ascontiguousarray(points, dtype=np.float64), sensor, heights, angles)
    is_unmeasured = np.isposinf(scan.ranges) & (cleared < CLEARED)
    return scan._replace(ranges=np.where(is_unmeasured, np.float32(np.nan), scan.ranges))


@njit(cache=True, error_model="numpy")
def cleared_per_bin(
    points: Floats, sensor: Floats, heights: tuple[float, float], angles: tuple[float, float, int]
) -> Floats:
    """Greatest distance from the sensor at which a ray to a point is between the heights, per bin: (B,) [m]; 0: none.

    points (N, 3), sensor (3,) [m]; heights: (lowest, highest) [m]; angles: first bearing, increment [rad] and number
    of the bins. Each ray is cut where it leaves the heights, and counts in the bin of that place.
    """
    cleared = np.zeros(angles[2])
    sx, sy, sz = sensor[0], sensor[1], sensor[2]
    for k in range(len(points)):
        dx, dy, dz = points[k, 0] - sx, points[k, 1] - sy, points[k, 2] - sz
        # Share of the ray until it leaves the heights; a ray that never is between them has none.
        end = 1.0
        if sz + dz < heights[0]:
            end = (heights[0] - sz) / dz
        elif sz + dz > heights[1]:
            end = (heights[1] - sz) / dz
        if not 0.0 < end <= 1.0:  # also drops NaN
            continue
        bearing = math.atan2(sy + end * dy, sx + end * dx)
        i = int((bearing - angles[0]) / angles[1])
        if 0 <= i < len(cleared):
            cleared[i] = max(cleared[i], end * math.hypot(dx, dy))
    return cleared


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
        # Height in the scan's frame, and then the place on its plane.
        z_base = transform[2, 0] * x + transform[2, 1] * y + transform[2, 2] * z + transform[2, 3]
        if not (heights[0] <= z_base <= heights[1]):  # also drops NaN
            continue
        x_base = transform[0, 0] * x + transform[0, 1] * y + transform[0, 2] * z + transform[0, 3]
        y_base = transform[1, 0] * x + transform[1, 1] * y + transform[1, 2] * z + transform[1, 3]
        distance = math.hypot(x_base, y_base)
        if not (spans[0] <= distance <= spans[1]):  # also drops NaN
            continue
        bearing = math.atan2(y_base, x_base)
        if angles[0] <= bearing <= angles[1]:
            i = min(int((bearing - angles[0]) / angles[2]), len(ranges) - 1)
            ranges[i] = min(ranges[i], np.float32(distance))
    return ranges
