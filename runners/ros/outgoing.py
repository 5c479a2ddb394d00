"""Messages that are published, and the markers of a decision for RViz and Foxglove as plain data.

Both versions of ROS use the same field names. The markers show candidates by score, subgoal, path, sectors, A and B,
and people with their motion in the next second, in the colours of the explainer page: viridis for scores, Okabe and
Ito's for sectors and marks.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterator, Mapping, Sequence
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.guides.lme.surmount import sector_points
from lme.live.messages import SECOND
from lme.simulation.simulator import Attitude, LidarCloud
from lme.types import Floats, Guidance, LaserScan, Observation, Pose, Twist
from runners.ros.transport import Transport

_LEVEL = Attitude()
_FLOAT_SIZE = 4  # [bytes]
_DELETE_ALL = 3  # visualization_msgs/Marker
OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/DiagnosticStatus
_VIRIDIS = np.array(
    [
        (0.267, 0.005, 0.329),
        (0.254, 0.265, 0.530),
        (0.164, 0.471, 0.558),
        (0.135, 0.659, 0.518),
        (0.478, 0.821, 0.318),
        (0.993, 0.906, 0.144),
    ]
)
_SECTORS = np.array([(0.902, 0.624, 0.0), (0.337, 0.706, 0.914), (0.835, 0.369, 0.0), (0.8, 0.475, 0.655)])
_SUBGOAL = np.array([0.835, 0.369, 0.0])
_TARGET = np.array([0.0, 0.620, 0.451])
_PATH = np.array([0.0, 0.447, 0.698])
_PERSON = np.array([0.8, 0.475, 0.655])
_INK = np.array([0.1, 0.1, 0.1])
_CLIP = (0.05, 0.95)  # otherwise a few extreme scores would use up the scale
_DOT, _LINE, _MARK, _LETTER = 0.04, 0.03, 0.16, 0.25  # [m]


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

    def cloud(self, time_ns: int, frame: str, cloud: LidarCloud) -> Any:
        """Return a sensor_msgs/PointCloud2. time_ns: of its end.

        The fields are x, y and z [m]. A cloud with times also has `time` [s], which counts from the stamp, that of the
        first point.
        """
        message = self._ros.type("sensor_msgs/PointCloud2")()
        columns, start = [*cloud.points.T], 0.0
        if cloud.times is not None:
            start = float(cloud.times.min(initial=0.0))
            columns.append(cloud.times - start)
        self._head(message, time_ns + round(start * SECOND), frame)
        field = self._ros.type("sensor_msgs/PointField")
        message.fields = [
            field(name=name, offset=_FLOAT_SIZE * k, datatype=field.FLOAT32, count=1)
            for k, name in enumerate(("x", "y", "z", "time")[: len(columns)])
        ]
        message.height, message.width, message.is_dense = 1, len(cloud.points), True
        message.point_step = _FLOAT_SIZE * len(columns)
        message.row_step = message.point_step * message.width
        data = np.column_stack(columns).astype("<f4").tobytes()
        message.data = array("B", data) if self._ros.version == 2 else data
        return message

    def imu(self, time_ns: int, frame: str, yaw: float, attitude: Attitude) -> Any:
        """Return a sensor_msgs/Imu that measures the orientation alone."""
        message = self._ros.type("sensor_msgs/Imu")()
        self._head(message, time_ns, frame)
        _set_orientation(message.orientation, yaw, attitude)
        for name in ("angular_velocity_covariance", "linear_acceleration_covariance"):
            setattr(message, name, [-1.0] + [0.0] * 8)  # not measured
        return message

    def odometry(
        self, time_ns: int, frame: str, child: str, pose: Pose, twist: Twist, attitude: Attitude = _LEVEL
    ) -> Any:
        """Return a nav_msgs/Odometry."""
        message = self._ros.type("nav_msgs/Odometry")()
        self._head(message, time_ns, frame)
        message.child_frame_id = child
        self._set_pose(message.pose.pose, pose, attitude)
        message.twist.twist.linear.x, message.twist.twist.angular.z = float(twist.v), float(twist.omega)
        return message

    def pose(self, time_ns: int, frame: str, pose: Pose) -> Any:
        """Return a geometry_msgs/PoseStamped."""
        message = self._ros.type("geometry_msgs/PoseStamped")()
        self._head(message, time_ns, frame)
        self._set_pose(message.pose, pose)
        return message

    def transform(self, time_ns: int, frame: str, child: str, pose: Pose, attitude: Attitude = _LEVEL) -> Any:
        """Return a tf2_msgs/TFMessage with one transform."""
        stamped = self._ros.type("geometry_msgs/TransformStamped")()
        self._head(stamped, time_ns, frame)
        stamped.child_frame_id = child
        transform = stamped.transform
        transform.translation.x, transform.translation.y = float(pose.x), float(pose.y)
        transform.translation.z = attitude.height
        _set_orientation(transform.rotation, pose.yaw, attitude)
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

    def _set_pose(self, message: Any, pose: Pose, attitude: Attitude = _LEVEL) -> None:
        message.position.x, message.position.y = float(pose.x), float(pose.y)
        message.position.z = attitude.height
        _set_orientation(message.orientation, pose.yaw, attitude)


def _set_orientation(quaternion: Any, yaw: float, attitude: Attitude) -> None:
    """Set a quaternion that turns by roll about x, then by pitch about y, then by yaw about z."""
    (sr, cr), (sp, cp), (sy, cy) = (
        (math.sin(angle / 2), math.cos(angle / 2)) for angle in (attitude.roll, attitude.pitch, yaw)
    )
    quaternion.x, quaternion.y = cy * cp * sr - sy * sp * cr, cy * sp * cr + sy * cp * sr
    quaternion.z, quaternion.w = sy * cp * cr - cy * sp * sr, cy * cp * cr + sy * sp * sr


class Shape(IntEnum):
    """Values of `type` in visualization_msgs/Marker."""

    LINE_STRIP = 4
    SPHERES = 7
    POINTS = 8
    TEXT = 9


class Marker(NamedTuple):
    """A marker in the base frame.

    points: (N, 2) [m]. colours: (N, 3), or (1, 3) for all: red, green, blue from 0 to 1. size: of a point, the width
    of a line, or the height of a letter [m].
    """

    group: str
    number: int
    shape: Shape
    points: Floats
    colours: Floats
    size: float
    text: str = ""


def markers(observation: Observation, guidance: Guidance, explanation: Explanation | None) -> list[Marker]:
    """Return the markers of one decision. A guide that cannot explain has fewer."""
    all_markers = [] if explanation is None else [*_explanation_markers(explanation)]
    if guidance.path is not None and len(guidance.path) > 1:
        all_markers.append(Marker("path", 0, Shape.LINE_STRIP, guidance.path, _PATH[None], _LINE))
    all_markers += _people(observation.pedestrians)
    all_markers.append(_mark("target", observation.target, _TARGET))
    all_markers.append(_mark("subgoal", guidance.subgoal, _SUBGOAL))
    return all_markers


def _explanation_markers(explanation: Explanation) -> Iterator[Marker]:
    yield Marker("candidates", 0, Shape.POINTS, explanation.candidates, _shades(explanation.scores), _DOT)
    # Each sector as a line through its points, and a single point as a ball.
    for k, sector in enumerate(explanation.sectors):
        points = sector_points(explanation.view.points, sector)
        shape = Shape.LINE_STRIP if len(points) > 1 else Shape.SPHERES
        yield Marker("sectors", k, shape, points, _SECTORS[None, k % len(_SECTORS)], _LINE)
    blockage = explanation.view.blockage
    if blockage is not None:
        for k, (name, point) in enumerate((("A", blockage.A), ("B", blockage.B))):
            yield Marker("A and B", k, Shape.SPHERES, point[None], _INK[None], _MARK / 2)
            yield Marker("letters", k, Shape.TEXT, point[None], _INK[None], _LETTER, name)


def _people(pedestrians: Floats) -> Iterator[Marker]:
    """Yield a mark for each person (P, 4), and a line to the person's position a second later."""
    for k, (x, y, vx, vy) in enumerate(pedestrians):
        displacement = np.array([(x, y), (x + vx, y + vy)])
        yield Marker("people", k, Shape.SPHERES, displacement[:1], _PERSON[None], 2.0 * _MARK)
        yield Marker("people in a second", k, Shape.LINE_STRIP, displacement, _PERSON[None], _LINE)


def _mark(group: str, point: Floats, colour: Floats) -> Marker:
    return Marker(group, 0, Shape.SPHERES, point[None], colour[None], _MARK)


def _shades(scores: Floats) -> Floats:
    """Return the (N, 3) colours of (N,) scores."""
    low, high = np.quantile(scores, _CLIP)
    share = np.clip((scores - low) / (high - low), 0.0, 1.0) if high > low else np.full(len(scores), 0.5)
    stops = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.column_stack([np.interp(share, stops, channel) for channel in _VIRIDIS.T])
