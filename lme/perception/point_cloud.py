"""Points of a 3D cloud with the layout of ROS `sensor_msgs/PointCloud2`, and their projection to a planar scan.

The conventions are those of the ROS package `pointcloud_to_laserscan`, so its parameters carry over unchanged.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError, require
from lme.types import Floats, LaserScan

_TYPES = {7: "f4", 8: "f8"}  # sensor_msgs/PointField: FLOAT32, FLOAT64
_TYPE_NAMES = dict(
    enumerate(("INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64"), start=1)
)
_TIMES = ("timestamp", "time", "t")  # fields with the time of a point
_TIME_TYPES = {6: "u4", **_TYPES}  # UINT32 besides
_EPOCH = 1e6  # [s] later times are since 1970
_LONGEST = 1.0  # [s] no point of a cloud is measured longer before or after its stamp
_SECOND = 1e9  # [ns]
_NOT_RIGID = 1e-3  # deviation from orthonormal; accepts a rotation written with four digits
_MOST_BEAMS = 100_000
_ROUNDING = 1e-6  # for π written with six digits or as float32
CLEARED = 3.0  # [m] ASSUMED: a level Mid-360, .45 m high, sees the floor from 3.7 m on


class PointField(Protocol):
    """One channel of a cloud, as in ROS `sensor_msgs/PointField`."""

    @property
    def name(self) -> str: ...
    @property
    def offset(self) -> int: ...  # [bytes] from the start of a point
    @property
    def datatype(self) -> int: ...  # 1 INT8 … 7 FLOAT32, 8 FLOAT64
    @property
    def count(self) -> int: ...


class PointCloud2(Protocol):
    """The fields of a ROS `sensor_msgs/PointCloud2` that are read; a message of any ROS library fits."""

    @property
    def height(self) -> int: ...  # rows; 1 for an unorganised cloud
    @property
    def width(self) -> int: ...  # points per row
    @property
    def fields(self) -> Sequence[Any]: ...  # of PointField
    @property
    def is_bigendian(self) -> bool: ...
    @property
    def point_step(self) -> int: ...  # [bytes]
    @property
    def row_step(self) -> int: ...  # [bytes]
    @property
    def data(self) -> Any: ...  # bytes, or an array of uint8


def cloud_points(cloud: PointCloud2) -> Floats:
    """Points of a PointCloud2, row by row: (N, 3) [m], NaN for no return.

    Raises InputError if x, y or z is missing or not a float, or if the layout does not fit the data.
    """
    return _channels(cloud, _layout(cloud, tuple("xyz"), _TYPES))


def point_times(cloud: PointCloud2, stamp: int) -> Floats | None:
    """Time of each point after the stamp of the cloud, row by row: (N,) [s]; None if the cloud does not say.

    stamp [ns]: of the cloud. Drivers name the field `timestamp`, since 1970 (Livox: ns; Hesai, RoboSense: s), `time`
    (Velodyne, Unitree: s after the stamp) or `t` (Ouster: ns after the stamp, as an integer).
    """
    field = next((f for f in cloud.fields if f.name in _TIMES and f.datatype in _TIME_TYPES), None)
    if field is None:
        return None
    times = _channels(cloud, _layout(cloud, (field.name,), _TIME_TYPES))[:, 0]
    latest = times.max(initial=0.0)
    if field.datatype not in _TYPES:
        times = times / _SECOND
    elif latest > _EPOCH * _SECOND:
        times = (times - stamp) / _SECOND
    elif latest > _EPOCH:
        times = times - stamp / _SECOND
    return times if len(times) and np.ptp(times) > 0.0 and (np.abs(times) <= _LONGEST).all() else None


def rigid_transform(mount: ArrayLike) -> Floats:
    """Homogeneous transform (4, 4) from the sensor's frame to the base frame.

    mount: that matrix, or the sensor's pose (x, y, z [m], roll, pitch, yaw [rad]) about fixed axes as in URDF:
    first roll about x, then pitch about y, then yaw about z. Raises InputError for anything else, such as a
    matrix that scales or mirrors.
    """
    matrix = np.asarray(mount, dtype=np.float64)
    if matrix.shape == (6,) and np.isfinite(matrix).all():
        return _from_angles(*matrix.tolist())
    if matrix.shape == (4, 4) and _is_rigid(matrix):
        return matrix
    text = " ".join(np.array2string(matrix, precision=4, threshold=16).split())
    raise InputError(
        f"mount is {text}: must be six finite numbers (x, y, z [m], roll, pitch, yaw [rad]) or a 4 × 4 matrix "
        "of a rotation and a translation"
    )


def _channels(cloud: PointCloud2, layout: np.dtype[np.void]) -> Floats:
    """Channels of a layout, row by row: (N, C). Raises InputError if it does not fit the data."""
    names = layout.names or ()
    height, width = cloud.height, cloud.width
    if height * width == 0:
        return np.empty((0, len(names)))
    data = np.frombuffer(cloud.data, np.uint8)
    row_step = _row_step(cloud, len(data))
    grid: NDArray[np.void] = np.ndarray((height, width), layout, data, 0, (row_step, cloud.point_step))
    channels = np.empty((height, width, len(names)))
    for k, name in enumerate(names):
        channels[..., k] = grid[name]
    return channels.reshape(-1, len(names))


def _layout(cloud: PointCloud2, names: Sequence[str], types: Mapping[int, str]) -> np.dtype[np.void]:
    """Layout of channels of these types within a point."""
    fields: dict[str, PointField] = {field.name: field for field in cloud.fields}
    missing = [name for name in names if name not in fields]
    if missing:
        available = ", ".join(fields) or "none"
        raise InputError(
            f"PointCloud2 has no field {missing[0]!r}: must have x, y and z; its fields are {available}"
        )
    order = ">" if cloud.is_bigendian else "<"
    formats = [order + _format(fields[name], cloud.point_step, types) for name in names]
    offsets = [int(fields[name].offset) for name in names]
    itemsize = int(cloud.point_step)
    return np.dtype({"names": list(names), "formats": formats, "offsets": offsets, "itemsize": itemsize})


def _format(field: PointField, point_step: int, types: Mapping[int, str]) -> str:
    if field.datatype not in types or field.count > 1:
        name = _TYPE_NAMES.get(field.datatype, "unknown")
        raise InputError(
            f"PointCloud2 field {field.name!r} is {field.count} × datatype {field.datatype} ({name}): "
            "must be a single FLOAT32 (7) or FLOAT64 (8)"
        )
    size = np.dtype(types[field.datatype]).itemsize
    if not 0 <= field.offset <= point_step - size:
        raise InputError(
            f"PointCloud2 field {field.name!r} has offset {field.offset} and {size} bytes: must lie within "
            f"point_step {point_step}"
        )
    return types[field.datatype]


def _row_step(cloud: PointCloud2, num_bytes: int) -> int:
    """Bytes from row to row. Raises InputError if rows overlap or if the buffer is too short."""
    row = cloud.width * cloud.point_step
    row_step = cloud.row_step if cloud.height > 1 else row
    if row_step < row:
        raise InputError(
            f"PointCloud2 row_step is {row_step}: must be at least width × point_step = "
            f"{cloud.width} × {cloud.point_step} = {row}"
        )
    needed = (cloud.height - 1) * row_step + row
    if num_bytes < needed:
        raise InputError(
            f"PointCloud2 data has {num_bytes} bytes: must be at least {needed} for {cloud.height} × {cloud.width} "
            f"points of {cloud.point_step} bytes"
        )
    return int(row_step)


def _from_angles(x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> Floats:
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    transform = np.eye(4)
    transform[:3, :3] = about_z @ about_y @ about_x
    transform[:3, 3] = x, y, z
    return transform


def _is_rigid(matrix: Floats) -> bool:
    turn = matrix[:3, :3]
    return bool(
        np.isfinite(matrix).all()
        and (matrix[3] == [0.0, 0.0, 0.0, 1.0]).all()
        and np.abs(turn @ turn.T - np.eye(3)).max() < _NOT_RIGID
        and np.linalg.det(turn) > 0.0
    )


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
