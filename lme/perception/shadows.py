"""Returns in mid-air, between two surfaces: mixed pixels of a real lidar, and points that an interpolation invents."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.perception.scan_points import is_full_circle
from lme.types import LaserScan


def without_shadows(scan: LaserScan, angle: float) -> LaserScan:
    """Return the scan with NaN, which means nothing was measured, for every return between two surfaces.

    Such a return has a nearer and a farther neighbour, and the lines to both differ by less than `angle` from its beam
    [rad]. A wall that is seen at less than that angle is dropped too. The edges of surfaces stay, unlike with
    laser_filters/ScanShadowsFilter of ROS, which tests one neighbour at a time.
    """
    ranges = _without_shadows(
        scan.ranges,
        (scan.range_min, scan.range_max),
        math.cos(scan.angle_increment),
        math.sin(abs(scan.angle_increment)),
        math.tan(angle),
        is_full_circle(scan),
    )
    return scan._replace(ranges=ranges)


@njit(cache=True, error_model="numpy")
def _without_shadows(ranges, limits, cos, sin, slope, is_full_circle):
    """Ranges (B,) float32. cos, sin: of the increment; slope: tangent of the angle."""
    count = len(ranges)
    kept = ranges.copy()
    for i in range(0 if is_full_circle else 1, count if is_full_circle else count - 1):
        before, middle, after = ranges[i - 1], ranges[i], ranges[(i + 1) % count]
        nearest, farthest = min(before, middle, after), max(before, middle, after)
        if not (limits[0] <= nearest and farthest < limits[1]):  # also false for NaN
            continue
        # The two neighbours, ahead of and beside the return as seen along its beam.
        ahead_before, ahead_after = before * cos - middle, after * cos - middle
        is_between = ahead_before * ahead_after < 0.0
        if is_between and before * sin < slope * abs(ahead_before) and after * sin < slope * abs(ahead_after):
            kept[i] = np.nan
    return kept
