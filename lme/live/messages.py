"""Conversion of ROS messages of common_interfaces and geometry2 to the types of `lme.types`.

A message is any object with the fields of its type: of rclpy, of rospy, or of a recording.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lme.perception.point_cloud import cloud_points
from lme.types import Floats, LaserScan, Pose, Twist

LASER_SCAN, POINT_CLOUD = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"
ODOMETRY = "nav_msgs/msg/Odometry"
POSE, POSE_WITH_COVARIANCE = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
TRANSFORM = "geometry_msgs/msg/TransformStamped"
IMU = "sensor_msgs/msg/Imu"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
SECOND = 1_000_000_000  # [ns]
_UNIT = 1e-3  # greatest difference of the squared norm of a unit quaternion from 1


class Tilt(NamedTuple):
    """Roll and pitch [rad] about fixed axes, as in URDF: first roll about x, then pitch about y, then yaw about z."""

    roll: float
    pitch: float


def stamp_of(header: Any) -> int:
    """The stamp of a header [ns]; 0 if the driver did not set it."""
    return nanoseconds(header.stamp)


def nanoseconds(stamp: Any) -> int:
    """Return a ROS time as [ns]. rospy names its parts secs and nsecs."""
    if hasattr(stamp, "secs"):
        return int(stamp.secs) * SECOND + int(stamp.nsecs)
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def is_cloud(message: Any) -> bool:
    """Return whether a message with a scan is a PointCloud2, not a LaserScan."""
    return hasattr(message, "point_step")


def is_empty(message: Any) -> bool:
    """Return whether a scan measures nothing at all. A beam that meets nothing within range has measured that."""
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
    """Return whether the quaternion of a message with a pose is set, not left at zero."""
    return _is_set(_position_and_orientation(message, kind)[1])


def pose_matrix(message: Any, kind: str) -> Floats:
    """The pose of a message of type `kind` in 3D: transform (4, 4) from the base to the odometry frame."""
    return matrix_of(*_position_and_orientation(message, kind))


def imu_rotation(message: Any) -> Floats | None:
    """The orientation of an Imu: rotation (3, 3) to a frame whose z axis points up; None if it measures none.

    In an Imu without one, the first covariance is −1 (sensor_msgs/Imu), or the quaternion is zero or not finite.
    """
    if message.orientation_covariance[0] == -1.0 or not _is_set(message.orientation):
        return None
    rotation = _rotation(message.orientation)
    return rotation if np.isfinite(rotation).all() else None


def _is_set(orientation: Any) -> bool:
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
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation(rotation)
    matrix[:3, 3] = [float(getattr(translation, key)) for key in "xyz"]
    return matrix


def _rotation(quaternion: Any) -> Floats:
    """The rotation (3, 3) of a quaternion, which need not be normalised; the identity if it is unset."""
    x, y, z, w = (float(getattr(quaternion, key)) for key in "xyzw")
    norm = x * x + y * y + z * z + w * w
    s = 2.0 / norm if norm > 0.0 else 0.0
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )


def tilt_of(matrix: Floats) -> Tilt:
    """Roll and pitch of a rotation (3, 3) or transform (4, 4); both exactly 0 if it turns about z alone."""
    return Tilt(math.atan2(matrix[2, 1], matrix[2, 2]), math.asin(min(max(-float(matrix[2, 0]), -1.0), 1.0)))


def planar_matrix(matrix: Floats) -> tuple[Pose, bool]:
    """Return the planar pose of a transform (4, 4), and whether its z axis points down."""
    upside_down = bool(matrix[2, 2] < 0.0)
    return Pose(float(matrix[0, 3]), float(matrix[1, 3]), math.atan2(matrix[1, 0], matrix[0, 0])), upside_down


def _yaw(q: Any) -> float:
    if q.x == 0.0 and q.y == 0.0:  # exact for a rotation about z alone
        return math.remainder(2.0 * math.atan2(q.z, q.w), math.tau)
    if abs(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w - 1.0) > _UNIT:  # a driver did not normalise it
        return math.atan2(2.0 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z)
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
