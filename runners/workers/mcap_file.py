"""Write ROS 2 messages, made of observations and commands, to an MCAP file with rosbags (extra `replay`)."""

from __future__ import annotations

import math
import shutil
from collections.abc import Collection, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np

from lme.errors import InputError
from lme.requirements import install
from lme.types import LaserScan, Pose, Twist

_SECOND = 1_000_000_000
_ROSBAG2_VERSION: Final = 8  # 9 stores QoS profiles as text, which Humble cannot read (ros2/rosbag2#1476)


class McapMessages:
    """Factory of ROS messages. Stamps are in nanoseconds; names are those of the message definitions."""

    def __init__(self) -> None:
        self.store = _store()

    def text(self, data: str) -> Any:
        return self._make("std_msgs/msg/String", data)

    def scan(self, time_ns: int, frame: str, scan: LaserScan, period: float) -> Any:
        ranges = np.ascontiguousarray(scan.ranges, dtype=np.float32)
        angle_max = scan.angle_min + (len(ranges) - 1) * scan.angle_increment
        times = 0.0, period  # time between beams: none; between sweeps: a control period
        return self._make(
            "sensor_msgs/msg/LaserScan",
            self._header(time_ns, frame),
            *(scan.angle_min, angle_max, scan.angle_increment),
            *times,
            *(scan.range_min, scan.range_max),
            ranges,
            np.empty(0, dtype=np.float32),
        )

    def odometry(self, time_ns: int, frame: str, child: str, pose: Pose, twist: Twist) -> Any:
        exact = np.zeros(36)
        pose_with_covariance = self._make("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), exact)
        moving = self._make("geometry_msgs/msg/TwistWithCovariance", self.twist(twist), exact)
        return self._make(
            "nav_msgs/msg/Odometry", self._header(time_ns, frame), child, pose_with_covariance, moving
        )

    def transform(self, time_ns: int, frame: str, child: str, pose: Pose) -> Any:
        shift = self._make("geometry_msgs/msg/Vector3", pose.x, pose.y, 0.0)
        translation_and_rotation = self._make(
            "geometry_msgs/msg/Transform", shift, self._quaternion(pose.yaw)
        )
        stamped = self._make(
            "geometry_msgs/msg/TransformStamped",
            self._header(time_ns, frame),
            child,
            translation_and_rotation,
        )
        return self._make("tf2_msgs/msg/TFMessage", [stamped])

    def pose_stamped(self, time_ns: int, frame: str, pose: Pose) -> Any:
        return self._make("geometry_msgs/msg/PoseStamped", self._header(time_ns, frame), self._pose(pose))

    def point(self, time_ns: int, frame: str, x: float, y: float) -> Any:
        point = self._make("geometry_msgs/msg/Point", x, y, 0.0)
        return self._make("geometry_msgs/msg/PointStamped", self._header(time_ns, frame), point)

    def twist(self, twist: Twist) -> Any:
        linear = self._make("geometry_msgs/msg/Vector3", float(twist.v), 0.0, 0.0)
        angular = self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, float(twist.omega))
        return self._make("geometry_msgs/msg/Twist", linear, angular)

    def _pose(self, pose: Pose) -> Any:
        point = self._make("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)
        return self._make("geometry_msgs/msg/Pose", point, self._quaternion(pose.yaw))

    def _quaternion(self, yaw: float) -> Any:
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, *half_angle(yaw))

    def _header(self, time_ns: int, frame: str) -> Any:
        stamp = self._make("builtin_interfaces/msg/Time", *divmod(time_ns, _SECOND))
        return self._make("std_msgs/msg/Header", stamp, frame)

    def _make(self, name: str, *fields: Any) -> Any:
        return self.store.types[name](*fields)


@cache
def _store() -> Any:
    """Return the message types of ROS 2 Humble, once per process: an encoder is compiled for every type used."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def half_angle(yaw: float) -> tuple[float, float]:
    """Return (z, w) of the quaternion of a yaw in [−π, π] [rad] such that 2·atan2(z, w) equals it exactly.

    z and w are sine and cosine of half the yaw, rounded up or down if rounding to nearest loses the last bit.
    """
    z, w = math.sin(yaw / 2), math.cos(yaw / 2)
    neighbours = product(_with_float_neighbours(z), _with_float_neighbours(w))
    return next((pair for pair in neighbours if 2.0 * math.atan2(*pair) == yaw), (z, w))


def _with_float_neighbours(value: float) -> tuple[float, float, float]:
    return value, math.nextafter(value, math.inf), math.nextafter(value, -math.inf)


def check_installed() -> None:
    """Raise InputError unless rosbags, which writes the files, is installed."""
    try:
        import rosbags.rosbag2
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError(f"record=mcap needs the package rosbags: {install('rosbags')}") from error


class McapFile:
    """MCAP file that is being written; use as a context manager.

    The file gets its name, and replaces an older one, when it is complete. If an exception ends it, no file is left.
    topics: message types by name. latched: topics that late subscribers receive as well. advice: what to do if the
    file cannot be written, for the InputError that is then raised.
    """

    def __init__(self, path: Path, topics: Mapping[str, str], latched: Collection[str], advice: str) -> None:
        self._path = path
        self._partial = path.with_suffix(".partial")
        self._bag = self._partial / path.stem  # rosbags writes a folder, with a file of the same name in it
        self._topics, self._latched, self._advice = topics, latched, advice

    def __enter__(self) -> Self:
        check_installed()
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        self.messages = McapMessages()
        try:
            shutil.rmtree(self._partial, ignore_errors=True)  # a killed run may have left it
            self._writer = Writer(self._bag, version=_ROSBAG2_VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except OSError as error:
            raise self._unwritable(error) from error
        self._connections = {topic: self._connect(topic) for topic in self._topics}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._writer.__exit__(kind, error, trace)
            if kind is None:
                (self._bag / self._path.name).replace(self._path)
        except OSError as failure:
            raise self._unwritable(failure) from failure
        finally:
            shutil.rmtree(self._partial, ignore_errors=True)

    def write(self, topic: str, message: Any, time_ns: int) -> None:
        """Add a message at `time_ns`."""
        data = self.messages.store.serialize_cdr(message, self._topics[topic])
        try:
            self._writer.write(self._connections[topic], time_ns, data)
        except OSError as error:
            raise self._unwritable(error) from error

    def _connect(self, topic: str) -> Any:
        qos = [_latched()] if topic in self._latched else []
        kind, store = self._topics[topic], self.messages.store
        return self._writer.add_connection(topic, kind, typestore=store, offered_qos_profiles=qos)

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(f"{self._path}: cannot be written ({error.strerror or error}): {self._advice}")


def _latched() -> Any:
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    unset = QosTime(0, 0)
    return Qos(
        QosHistory.KEEP_LAST,
        1,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL,
        deadline=unset,
        lifespan=unset,
        liveliness=QosLiveliness.SYSTEM_DEFAULT,
        liveliness_lease_duration=unset,
        avoid_ros_namespace_conventions=False,
    )
