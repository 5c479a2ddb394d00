"""Conversion of any planar scan to the policy's form: counter-clockwise, upright, inf for "no return"."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.errors import InputError
from lme.geometry.frames import compose
from lme.robots import Lidar
from lme.types import LaserScan, Pose

Ranges = NDArray[np.float32]

# Angle of incidence: neighbours farther apart than on a wall hit at this angle are on two surfaces.
_GRAZING = math.radians(80.0)
_SAME_BEARING = 1e-6  # [rad] rounding of angles in float32
_TURNS = (-2.0 * math.pi, 0.0, 2.0 * math.pi)  # the bearings of one direction differ by whole turns


def tidied(scan: LaserScan, upside_down: bool = False) -> LaserScan:
    """Return the same scan, counter-clockwise in the frame of an upright lidar, without repeated directions.

    A beam without a return becomes inf: a range that is infinite, ≤ 0 (many drivers), below range_min or ≥ range_max
    (sensor_msgs/LaserScan). NaN stays: the measurement failed, so it is not known whether the beam is free (REP-117).
    angle_increment [rad] may be negative. upside_down: the lidar is mounted with its z axis down, so its bearings are
    reversed. Raises InputError for fewer than two beams, and for angles or limits that are not numbers.
    """
    _check(scan)
    sign = -1.0 if upside_down else 1.0
    first, increment = sign * scan.angle_min, sign * scan.angle_increment
    ranges = np.array(scan.ranges, dtype=np.float32)
    if increment < 0.0:
        first, increment = first + (len(ranges) - 1) * increment, -increment
        ranges = ranges[::-1].copy()
    ranges = ranges[: max(2, round(2.0 * math.pi / increment))]  # some drivers repeat the first beam
    with np.errstate(invalid="ignore"):
        valid = (
            (ranges > 0.0) & (ranges >= np.float32(scan.range_min)) & (ranges < np.float32(scan.range_max))
        )
    ranges[~valid & ~np.isnan(ranges)] = np.inf
    return LaserScan(ranges, first, increment, scan.range_min, scan.range_max)


def own_lidar(scan: LaserScan, mount: Pose) -> tuple[Lidar, LaserScan]:
    """Lidar that produced a tidied scan, and the scan in that lidar's frame with unchanged ranges.

    mount: pose of the scan's frame in the base frame. A `Lidar` faces the middle of its field of view, so an
    asymmetric scan gives a rotated lidar.
    """
    num_beams = len(scan.ranges)
    is_full_circle = (num_beams + 0.5) * scan.angle_increment >= 2.0 * math.pi
    fov = 2.0 * math.pi if is_full_circle else (num_beams - 1) * scan.angle_increment
    pose = compose(mount, Pose(0.0, 0.0, scan.angle_min + fov / 2.0))
    lidar = Lidar(num_beams, fov, scan.range_min, scan.range_max, 0.0, pose.x, pose.y, pose.yaw)
    return lidar, scan._replace(angle_min=lidar.angle_min, angle_increment=lidar.angle_increment)


def same_lidar(first: Lidar, second: Lidar) -> bool:
    """Return whether two lidars are the same to the precision of a message, whose angles and ranges are float32."""
    if first.num_beams != second.num_beams:
        return False
    pairs = (
        (getattr(first, key), getattr(second, key)) for key in ("fov", "range_min", "range_max", "x", "y")
    )
    yaw = math.remainder(first.yaw - second.yaw, math.tau)
    return abs(yaw) < 1e-5 and all(math.isclose(a, b, rel_tol=1e-5, abs_tol=1e-5) for a, b in pairs)


def resampled(scan: LaserScan, mount: Pose, lidar: Lidar) -> LaserScan:
    """Resample a tidied scan as another lidar on the same robot would have measured it.

    mount: pose of the scan's frame in the base frame. Each return goes to the beam nearest in direction; the
    nearest return of a beam counts. Beams between neighbours on one surface are interpolated along the straight
    line, but not across a depth edge. A beam without data, e.g. outside the old field of view, is inf, but NaN where
    an old beam in its sector is NaN.

    For a lidar with `native_beams` at the scan's place, ranges are interpolated instead, as in the paper (§V.A):
    linearly in the bearing, also across depth edges, where this invents points between two surfaces. If one of
    the two neighbours has no return, the beam takes the nearer one's reading.
    """
    target = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    if lidar.native_beams is not None and (mount.x, mount.y) == (lidar.x, lidar.y):
        first = scan.angle_min + mount.yaw - lidar.yaw
        ranges = _interpolate(scan.ranges, (first, scan.angle_increment), target)
    else:
        source = (scan.angle_min, scan.angle_increment)
        ranges = _resample(scan.ranges, source, mount, lidar.mount, target, math.cos(_GRAZING))
        if np.isnan(scan.ranges).any():
            _mark_failed(ranges, scan.ranges, source, mount[2] - lidar.yaw, target)
    ranges[(ranges < np.float32(lidar.range_min)) | (ranges >= np.float32(lidar.range_max))] = np.inf
    return LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)


def nearest_by_sector(ranges: Ranges, count: int) -> Ranges:
    """Return the nearest return in each sector of neighbouring beams: (..., count) [m].

    ranges (..., B) [m]; count: at most B. Sectors differ by one beam if count does not divide B.
    """
    first_beams = np.arange(count) * ranges.shape[-1] // count
    nearest: Ranges = np.minimum.reduceat(ranges, first_beams, axis=-1)
    return nearest


def _check(scan: LaserScan) -> None:
    if len(scan.ranges) < 2:
        raise InputError(f"the scan has {len(scan.ranges)} beams: must have at least 2")
    if not (math.isfinite(scan.angle_min) and math.isfinite(scan.angle_increment) and scan.angle_increment):
        raise InputError(
            f"the scan begins at {scan.angle_min:g} rad with increments of {scan.angle_increment:g} rad: "
            "must be finite, and the increment not 0"
        )
    if not 0.0 <= scan.range_min < scan.range_max < math.inf:
        raise InputError(
            f"the scan's ranges go from {scan.range_min:g} to {scan.range_max:g} m: "
            "must be finite and rise; set scan.range_min and scan.range_max"
        )


@njit(cache=True, error_model="numpy")
def _interpolate(ranges, source, target):
    """Interpolate ranges linearly in the bearing: (num_beams,) float32 [m].

    source (angle_min, increment), target (angle_min, increment, num_beams).
    """
    count, increment = len(ranges), source[1]
    is_full_circle = (count + 0.5) * increment >= 2.0 * math.pi
    interpolated = np.full(target[2], np.inf, np.float32)
    for k in range(target[2]):
        # Place of the beam among those of the source.
        position = (target[0] + k * target[1] - source[0] + _SAME_BEARING) % (2.0 * math.pi) / increment
        i = int(position)
        part = max(position - i - _SAME_BEARING / increment, 0.0)
        if not is_full_circle and i >= count - 1:  # in the blind arc, or at its first beam
            if i == count - 1 and part * increment <= _SAME_BEARING:
                interpolated[k] = ranges[i]
            continue
        range_m, next_range = ranges[i % count], ranges[(i + 1) % count]
        # Linear between two returns, otherwise the reading of the nearer beam.
        if math.isfinite(range_m) and math.isfinite(next_range):
            interpolated[k] = range_m + part * (next_range - range_m)
        else:
            interpolated[k] = range_m if part < 0.5 else next_range
    return interpolated


@njit(cache=True, error_model="numpy")
def _resample(ranges, source, mount, onto_mount, target, cos_grazing):
    """Give returns to the nearest beams and interpolate along surfaces: (num_beams,) float32 [m].

    source (angle_min, increment), target (angle_min, increment, num_beams).
    """
    angle_min, increment, num_beams = target
    resampled = np.full(num_beams, np.inf, np.float32)
    widest = 2.0 * math.sin(source[1] / 2.0) / cos_grazing  # [-] greatest gap on one surface, per range
    is_full_circle = (len(ranges) + 0.5) * source[1] >= 2.0 * math.pi
    for i in range(len(ranges)):
        if not math.isfinite(ranges[i]):
            continue
        x, y = _point(ranges[i], source[0] + i * source[1], mount, onto_mount)
        # The return goes to the beam nearest in direction.
        offset = math.atan2(y, x) - angle_min
        for shift in _TURNS:
            nearest = round((offset + shift) / increment)
            if 0 <= nearest < num_beams:
                resampled[nearest] = min(resampled[nearest], np.float32(math.hypot(x, y)))
        # The beams between it and the next return, if both are on one surface.
        j = i + 1 if i + 1 < len(ranges) else 0
        if (j == 0 and not is_full_circle) or not math.isfinite(ranges[j]):
            continue
        u, v = _point(ranges[j], source[0] + j * source[1], mount, onto_mount)
        if math.hypot(u - x, v - y) <= widest * max(ranges[i], ranges[j]):
            _span(resampled, x, y, u, v, angle_min, increment)
    return resampled


@njit(cache=True, error_model="numpy")
def _mark_failed(resampled, ranges, source, turn, target):
    """Make beams without data NaN where a beam of the source in their sector is NaN. turn: source from target [rad]."""
    half = max(0.5 * target[1] / source[1] - 0.5, 0.0)  # of the sector, beyond the nearest beam
    for k in range(len(resampled)):
        if math.isinf(resampled[k]):
            # Beams of the source within the sector of beam k.
            offset = (target[0] + k * target[1] - turn - source[0]) / source[1]
            for shift in _TURNS:
                position = offset + shift / source[1]
                for i in range(max(round(position - half), 0), min(round(position + half) + 1, len(ranges))):
                    if math.isnan(ranges[i]):
                        resampled[k] = np.nan


@njit(cache=True, error_model="numpy")
def _span(resampled, x, y, u, v, angle_min, increment):
    """Shorten the beams that cross the segment from (x, y) to (u, v)."""
    start = math.atan2(y, x) - angle_min
    end = start + math.atan2(x * v - y * u, x * u + y * v)
    low, high = min(start, end), max(start, end)
    for shift in _TURNS:
        first_beam = max(math.ceil((low + shift) / increment), 0)
        last_beam = min(math.floor((high + shift) / increment), len(resampled) - 1)
        for k in range(first_beam, last_beam + 1):
            cos, sin = math.cos(angle_min + k * increment), math.sin(angle_min + k * increment)
            # Distance along the beam to the line through both ends.
            across = cos * (v - y) - sin * (u - x)
            if across != 0.0:
                resampled[k] = min(resampled[k], np.float32((x * (v - y) - y * (u - x)) / across))


@njit(cache=True, error_model="numpy")
def _point(distance, angle, mount, onto_mount):
    """End point of a beam in the frame of the lidar at `onto_mount`."""
    bearing = angle + mount[2]
    x = mount[0] + distance * math.cos(bearing) - onto_mount[0]
    y = mount[1] + distance * math.sin(bearing) - onto_mount[1]
    cos, sin = math.cos(onto_mount[2]), math.sin(onto_mount[2])
    return cos * x + sin * y, cos * y - sin * x
