"""Makes ROS 2 messages with the package rosbags (extra `replay`)."""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from lme.types import LaserScan, Pose, Twist

_SECOND = 1_000_000_000


class McapMessages:
    """Makes ROS messages. Stamps are in nanoseconds; names are those of the message definitions."""

    def __init__(self) -> None:
        self.store = _store()

    def text(self, data: str) -> Any:
        return self._make("std_msgs/msg/String", data)

    def scan(self, now: int, frame: str, scan: LaserScan, period: float) -> Any:
        ranges = np.ascontiguousarray(scan.ranges, dtype=np.float32)
        angle_max = scan.angle_min + (len(ranges) - 1) * scan.angle_increment
        times = 0.0, period  # no time between beams; one sweep per control period
        return self._make(
            "sensor_msgs/msg/LaserScan",
            self._header(now, frame),
            *(scan.angle_min, angle_max, scan.angle_increment),
            *times,
            *(scan.range_min, scan.range_max),
            ranges,
            np.empty(0, dtype=np.float32),
        )

    def odometry(self, now: int, frame: str, child: str, pose: Pose, twist: Twist) -> Any:
        exact = np.zeros(36)
        known = self._make("geometry_msgs/msg/PoseWithCovariance", self._pose(pose), exact)
        moving = self._make("geometry_msgs/msg/TwistWithCovariance", self.twist(twist), exact)
        return self._make("nav_msgs/msg/Odometry", self._header(now, frame), child, known, moving)

    def transform(self, now: int, frame: str, child: str, pose: Pose) -> Any:
        shift = self._make("geometry_msgs/msg/Vector3", pose.x, pose.y, 0.0)
        moved = self._make("geometry_msgs/msg/Transform", shift, self._quaternion(pose.yaw))
        stamped = self._make("geometry_msgs/msg/TransformStamped", self._header(now, frame), child, moved)
        return self._make("tf2_msgs/msg/TFMessage", [stamped])

    def pose_stamped(self, now: int, frame: str, pose: Pose) -> Any:
        return self._make("geometry_msgs/msg/PoseStamped", self._header(now, frame), self._pose(pose))

    def point(self, now: int, frame: str, x: float, y: float) -> Any:
        point = self._make("geometry_msgs/msg/Point", x, y, 0.0)
        return self._make("geometry_msgs/msg/PointStamped", self._header(now, frame), point)

    def twist(self, twist: Twist) -> Any:
        linear = self._make("geometry_msgs/msg/Vector3", float(twist.v), 0.0, 0.0)
        angular = self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, float(twist.omega))
        return self._make("geometry_msgs/msg/Twist", linear, angular)

    def _pose(self, pose: Pose) -> Any:
        point = self._make("geometry_msgs/msg/Point", pose.x, pose.y, 0.0)
        return self._make("geometry_msgs/msg/Pose", point, self._quaternion(pose.yaw))

    def _quaternion(self, yaw: float) -> Any:
        return self._make("geometry_msgs/msg/Quaternion", 0.0, 0.0, *half_angle(yaw))

    def _header(self, now: int, frame: str) -> Any:
        stamp = self._make("builtin_interfaces/msg/Time", *divmod(now, _SECOND))
        return self._make("std_msgs/msg/Header", stamp, frame)

    def _make(self, name: str, *fields: Any) -> Any:
        return self.store.types[name](*fields)


@cache
def _store() -> Any:
    """Message types of ROS 2 Humble. One store per process, because it compiles an encoder for every type used."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def half_angle(yaw: float) -> tuple[float, float]:
    """(z, w) of the quaternion of a yaw in [−π, π] [rad] such that 2·atan2(z, w) equals the yaw exactly.

    z and w are sine and cosine of half the yaw, rounded up or down if rounding to nearest loses the last bit.
    """
    z, w = math.sin(yaw / 2), math.cos(yaw / 2)
    near = product(_with_float_neighbours(z), _with_float_neighbours(w))
    return next((pair for pair in near if 2.0 * math.atan2(*pair) == yaw), (z, w))


def _with_float_neighbours(value: float) -> tuple[float, float, float]:
    return value, math.nextafter(value, math.inf), math.nextafter(value, -math.inf)
