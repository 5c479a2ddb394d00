"""Converts ROS messages of common_interfaces and geometry2 to the types of `lme.types`.

A message is any object with the fields of its type: of rclpy, of rospy, or of a recording.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lme.sensing.point_cloud import cloud_points
from lme.types import Floats, LaserScan, Pose, Twist

LASER_SCAN, POINT_CLOUD = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE, POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
SECOND = 1_000_000_000  # [ns]
_UNIT = 1e-3  # how far the square of the norm of a unit quaternion may be from 1


def stamp_of(header: Any) -> int:
    """The stamp of a header [ns]; 0 if the driver did not set it."""
    return nanoseconds(header.stamp)


def nanoseconds(stamp: Any) -> int:
    """A time [ns]. rospy names its parts secs and nsecs."""
    if hasattr(stamp, "secs"):
        return int(stamp.secs) * SECOND + int(stamp.nsecs)
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def is_cloud(message: Any) -> bool:
    """Whether a message with a scan is a PointCloud2, not a LaserScan."""
    return hasattr(message, "point_step")


def is_empty(message: Any) -> bool:
    """Whether a scan measures nothing at all. A beam that meets nothing within range has measured that."""
    if is_cloud(message):
        points = cloud_points(message)
        return not (np.isfinite(points).all(axis=1) & points.any(axis=1)).any()
    ranges = np.asarray(message.ranges, dtype=np.float32)
    return not ((ranges > 0.0) & ~(ranges < message.range_min)).any()


def kind_of_pose(message: Any) -> str:
    """The type of a message with a pose, by its fields."""
    if hasattr(message, "transform"):
        return TRANSFORM
    if hasattr(message, "twist"):
        return ODOMETRY
    return POSE_WITH_COVARIANCE if hasattr(message.pose, "pose") else POSE


def frame(name: str) -> str:
    """The name of a frame as in tf2, without the leading slash of ROS 1."""
    return str(name).lstrip("/")


def scan_of(message: Any) -> LaserScan:
    """The scan of a LaserScan message, unchanged. Its angles have the precision of float32."""
    return LaserScan(
        np.asarray(message.ranges, dtype=np.float32),
        float(message.angle_min),
        float(message.angle_increment),
        float(message.range_min),
        float(message.range_max),
    )


def pose_of(message: Any, kind: str) -> Pose:
    """The planar pose of a message of type `kind`: Odometry, a pose or a transform."""
    return planar(*_position_and_orientation(message, kind))


def has_orientation(message: Any, kind: str) -> bool:
    """Whether the quaternion of a message with a pose is set, not left at zero."""
    _, orientation = _position_and_orientation(message, kind)
    return any(getattr(orientation, key) != 0.0 for key in "xyzw")


def _position_and_orientation(message: Any, kind: str) -> tuple[Any, Any]:
    """Position and orientation in a message with a pose."""
    if kind == TRANSFORM:
        return message.transform.translation, message.transform.rotation
    pose = message.pose.pose if kind in (ODOMETRY, POSE_WITH_COVARIANCE) else message.pose
    return pose.position, pose.orientation


def planar(position: Any, orientation: Any) -> Pose:
    """x, y [m] and yaw [rad] of a pose in 3D."""
    return Pose(float(position.x), float(position.y), _yaw(orientation))


def twist_of(message: Any, kind: str) -> Twist:
    """Forward velocity [m/s] and turn rate [rad/s] of an Odometry or a command."""
    stamped = {ODOMETRY: 2, TWIST_STAMPED: 1, TWIST: 0}[kind]
    for _ in range(stamped):
        message = message.twist
    return Twist(float(message.linear.x), float(message.angular.z))


def matrix_of(translation: Any, rotation: Any) -> Floats:
    """Transform (4, 4) from the child to the parent frame, from a translation [m] and a quaternion."""
    x, y, z, w = (float(getattr(rotation, key)) for key in "xyzw")
    norm = x * x + y * y + z * z + w * w
    s = 2.0 / norm if norm > 0.0 else 0.0  # an unset quaternion counts as no rotation
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    matrix[:3, 3] = [float(getattr(translation, key)) for key in "xyz"]
    return matrix


def planar_matrix(matrix: Floats) -> tuple[Pose, bool]:
    """The planar pose of a transform (4, 4), and whether its z axis points down."""
    upside_down = bool(matrix[2, 2] < 0.0)
    return Pose(float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0])), upside_down


def _yaw(q: Any) -> float:
    if q.x == 0.0 and q.y == 0.0:  # exact for a rotation about z alone
        return math.remainder(2.0 * math.atan2(q.z, q.w), math.tau)
    if abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) > _UNIT:  # a driver did not normalise it
        return math.atan2(2.0 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z)
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
