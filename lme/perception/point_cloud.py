"""Points of a 3D cloud with the layout of ROS `sensor_msgs/PointCloud2`, and the mount of the sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError
from lme.types import Floats

_TYPES = {7: "f4", 8: "f8"}  # sensor_msgs/PointField: FLOAT32, FLOAT64
_TYPE_NAMES = dict(
    enumerate(("INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64"), start=1)
)
_TIMES, _TIME_TYPES = (
    ("timestamp", "time", "t"),
    {6: "u4", **_TYPES},
)  # fields with the time of a point; UINT32
_EPOCH = 1e6  # [s] later times are since 1970
_LONGEST = 1.0  # [s] no point of a cloud is measured longer before or after its stamp
_SECOND = 1e9  # [ns]
_NOT_RIGID = 1e-3  # deviation from orthonormal; accepts a rotation written with four digits


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
