"""Messages that are published. Both versions of ROS use the same field names."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lme.types import Floats, LaserScan, Pose, Twist
from runners.ros.markers import Marker, Shape
from runners.ros.transport import Transport

_DELETE_ALL = 3  # visualization_msgs/Marker
OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/DiagnosticStatus


class OutgoingMessages:
    """Factory of messages for one version of ROS. Stamps are in nanoseconds."""

    def __init__(self, transport: Transport) -> None:
        self._ros = transport

    def text(self, data: str) -> Any:
        """Return a std_msgs/String."""
        return self._ros.type("std_msgs/String")(data=data)

    def clock(self, time_ns: int) -> Any:
        """Return a rosgraph_msgs/Clock."""
        return self._ros.type("rosgraph_msgs/Clock")(clock=self._ros.stamp(time_ns))

    def command(self, kind: str, time_ns: int, frame: str, twist: Twist) -> Any:
        """Return a geometry_msgs/Twist or TwistStamped, according to `kind`."""
        message = self._ros.type(f"geometry_msgs/{kind}")()
        moving = message
        if kind == "TwistStamped":
            self._head(message, time_ns, frame)
            moving = message.twist
        moving.linear.x, moving.angular.z = float(twist.v), float(twist.omega)
        return message

    def scan(self, time_ns: int, frame: str, scan: LaserScan, period: float) -> Any:
        """Return a sensor_msgs/LaserScan. period: between scans [s]."""
        message = self._ros.type("sensor_msgs/LaserScan")()
        self._head(message, time_ns, frame)
        message.angle_min, message.angle_increment = scan.angle_min, scan.angle_increment
        message.angle_max = scan.angle_min + (len(scan.ranges) - 1) * scan.angle_increment
        message.range_min, message.range_max = scan.range_min, scan.range_max
        message.scan_time = period
        message.ranges = array("f", np.asarray(scan.ranges, np.float32).tobytes())
        return message

    def odometry(self, time_ns: int, frame: str, child: str, pose: Pose, twist: Twist) -> Any:
        """Return a nav_msgs/Odometry."""
        message = self._ros.type("nav_msgs/Odometry")()
        self._head(message, time_ns, frame)
        message.child_frame_id = child
        self._set_pose(message.pose.pose, pose)
        message.twist.twist.linear.x, message.twist.twist.angular.z = float(twist.v), float(twist.omega)
        return message

    def pose(self, time_ns: int, frame: str, pose: Pose) -> Any:
        """Return a geometry_msgs/PoseStamped."""
        message = self._ros.type("geometry_msgs/PoseStamped")()
        self._head(message, time_ns, frame)
        self._set_pose(message.pose, pose)
        return message

    def transform(self, time_ns: int, frame: str, child: str, pose: Pose) -> Any:
        """Return a tf2_msgs/TFMessage with one transform."""
        stamped = self._ros.type("geometry_msgs/TransformStamped")()
        self._head(stamped, time_ns, frame)
        stamped.child_frame_id = child
        transform = stamped.transform
        transform.translation.x, transform.translation.y = float(pose.x), float(pose.y)
        transform.rotation.z, transform.rotation.w = math.sin(pose.yaw / 2), math.cos(pose.yaw / 2)
        return self._ros.type("tf2_msgs/TFMessage")(transforms=[stamped])

    def point(self, time_ns: int, frame: str, point: Floats) -> Any:
        """Return a geometry_msgs/PointStamped. point: (2,) [m]."""
        message = self._ros.type("geometry_msgs/PointStamped")()
        self._head(message, time_ns, frame)
        message.point.x, message.point.y = map(float, point)
        return message

    def markers(self, time_ns: int, frame: str, shapes: Sequence[Marker]) -> Any:
        """Return a visualization_msgs/MarkerArray that replaces all earlier markers of the topic."""
        clear = self._ros.type("visualization_msgs/Marker")(action=_DELETE_ALL)
        self._head(clear, time_ns, frame)
        messages = [clear, *(self._marker(time_ns, frame, shape) for shape in shapes)]
        return self._ros.type("visualization_msgs/MarkerArray")(markers=messages)

    def diagnostics(
        self, time_ns: int, name: str, level: int, text: str, values: Mapping[str, object]
    ) -> Any:
        """Return a diagnostic_msgs/DiagnosticArray with one status."""
        array = self._ros.type("diagnostic_msgs/DiagnosticArray")()
        array.header.stamp = self._ros.stamp(time_ns)
        status = self._ros.type("diagnostic_msgs/DiagnosticStatus")(
            name=name, message=text, hardware_id="lme"
        )
        status.level = bytes([level]) if self._ros.version == 2 else level
        pair = self._ros.type("diagnostic_msgs/KeyValue")
        status.values = [pair(key=key, value=str(value)) for key, value in values.items()]
        array.status = [status]
        return array

    def _marker(self, time_ns: int, frame: str, shape: Marker) -> Any:
        message = self._ros.type("visualization_msgs/Marker")(
            ns=shape.group, id=shape.number, type=int(shape.shape)
        )
        self._head(message, time_ns, frame)
        message.pose.orientation.w = 1.0
        message.text = shape.text
        size = message.scale
        size.x = size.y = size.z = shape.size
        message.color = self._colour(shape.colours[0])
        # Text stands at a point, everything else is a list of points.
        if shape.shape is Shape.TEXT:
            message.pose.position.x, message.pose.position.y = map(float, shape.points[0])
            message.pose.position.z = shape.size
            return message
        point = self._ros.type("geometry_msgs/Point")
        message.points = [point(x=x, y=y, z=0.0) for x, y in shape.points.tolist()]
        if len(shape.colours) > 1:
            message.colors = [self._colour(colour) for colour in shape.colours]
        return message

    def _colour(self, colour: Floats) -> Any:
        red, green, blue = map(float, colour)
        return self._ros.type("std_msgs/ColorRGBA")(r=red, g=green, b=blue, a=1.0)

    def _head(self, message: Any, time_ns: int, frame: str) -> None:
        message.header.stamp, message.header.frame_id = self._ros.stamp(time_ns), frame

    def _set_pose(self, message: Any, pose: Pose) -> None:
        message.position.x, message.position.y = float(pose.x), float(pose.y)
        message.orientation.z, message.orientation.w = math.sin(pose.yaw / 2), math.cos(pose.yaw / 2)
