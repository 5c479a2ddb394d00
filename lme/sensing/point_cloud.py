"""Conversion of a 3D point cloud to a planar scan.

The conventions are those of the ROS package `pointcloud_to_laserscan`, so its parameters carry over unchanged.
Clouds have the layout of ROS `sensor_msgs/PointCloud2`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError, require
from lme.kernels.projection import nearest_per_bin
from lme.types import Floats, LaserScan

_TYPES = {7: "f4", 8: "f8"}  # sensor_msgs/PointField: FLOAT32, FLOAT64
_TYPE_NAMES = dict(
    enumerate(("INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64"), start=1)
)
_MOST_BEAMS = 100_000
_ROUNDING = 1e-6  # for π written with six digits or as float32
_NOT_RIGID = 1e-3  # deviation from orthonormal; accepts a rotation written with four digits


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
    """The points of a PointCloud2, row by row: (N, 3) [m], NaN for no return.

    Raises InputError if x, y or z is missing or not a float, or if the layout does not fit the data.
    """
    layout = _layout(cloud)
    height, width = cloud.height, cloud.width
    if height * width == 0:
        return np.empty((0, 3))
    data = np.frombuffer(cloud.data, np.uint8)
    row_step = _row_step(cloud, len(data))
    grid: NDArray[np.void] = np.ndarray((height, width), layout, data, 0, (row_step, cloud.point_step))
    points = np.empty((height, width, 3))
    for axis, name in enumerate("xyz"):
        points[..., axis] = grid[name]
    return points.reshape(-1, 3)


def rigid_transform(mount: ArrayLike) -> Floats:
    """Homogeneous transform (4, 4) from the sensor's frame to the base frame.

    mount: that matrix, or the sensor's pose (x, y, z [m], roll, pitch, yaw [rad]) about fixed axes as in URDF:
    first roll about x, then pitch about y, then yaw about z. Raises InputError for anything else, such as a
    matrix that scales or mirrors.
    """
    given = np.asarray(mount, dtype=np.float64)
    if given.shape == (6,) and np.isfinite(given).all():
        return _from_angles(*given.tolist())
    if given.shape == (4, 4) and _is_rigid(given):
        return given
    shown = " ".join(np.array2string(given, precision=4, threshold=16).split())
    raise InputError(
        f"mount is {shown}: must be six finite numbers (x, y, z [m], roll, pitch, yaw [rad]) or a 4 × 4 matrix "
        "of a rotation and a translation"
    )


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


def _layout(cloud: PointCloud2) -> np.dtype[np.void]:
    """Layout of x, y and z within a point."""
    fields: dict[str, PointField] = {field.name: field for field in cloud.fields}
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        there = ", ".join(fields) or "none"
        raise InputError(
            f"PointCloud2 has no field {missing[0]!r}: must have x, y and z; its fields are {there}"
        )
    order = ">" if cloud.is_bigendian else "<"
    formats = [order + _format(fields[name], cloud.point_step) for name in "xyz"]
    offsets = [int(fields[name].offset) for name in "xyz"]
    itemsize = int(cloud.point_step)
    return np.dtype({"names": list("xyz"), "formats": formats, "offsets": offsets, "itemsize": itemsize})


def _format(field: PointField, point_step: int) -> str:
    if field.datatype not in _TYPES or field.count > 1:
        name = _TYPE_NAMES.get(field.datatype, "unknown")
        raise InputError(
            f"PointCloud2 field {field.name!r} is {field.count} × datatype {field.datatype} ({name}): "
            "must be a single FLOAT32 (7) or FLOAT64 (8)"
        )
    size = np.dtype(_TYPES[field.datatype]).itemsize
    if not 0 <= field.offset <= point_step - size:
        raise InputError(
            f"PointCloud2 field {field.name!r} has offset {field.offset} and {size} bytes: must lie within "
            f"point_step {point_step}"
        )
    return _TYPES[field.datatype]


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
