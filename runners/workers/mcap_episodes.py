"""Record a simulated episode as ROS 2 messages in an MCAP file, which Foxglove, RViz and `lme replay` open.

The topic /lme carries, as JSON text, the values that no other message holds exactly; for example, ROS stores the
bearings of the beams as float32.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Collection, Mapping
from functools import cache
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np

import lme
from lme.errors import InputError
from lme.requirements import install
from lme.robots import Robot
from lme.simulation.simulator import State
from lme.types import Guidance, LaserScan, Observation, Pose, Twist
from runners.records.episode_record import EpisodeKey

FOLDER = "recordings"  # within a run's directory
TOPICS = {  # message types; the topics are in the order in which a control period writes them
    "/lme": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/goal": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/subgoal": "geometry_msgs/msg/PointStamped",
    "/cmd_vel": "geometry_msgs/msg/Twist",
}
# On a robot, /cmd_vel holds what was sent to it, and these topics the planner's commands, the reasons, the state and
# the stamps of the scans [ns].
WANTED, WHY, STATE, TAKEN = "/wanted", "/why", "/state", "/taken"
LATCHED = ("/lme", "/tf_static")  # written once; late subscribers receive them as well
ODOM, BASE, LASER = "odom", "base_link", "laser"
_ADVICE = "free some space there and add resume=true, or choose another directory with hydra.run.dir=PATH"
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


def recording_path(folder: Path, key: EpisodeKey) -> Path:
    """Return the path of the recording of one episode."""
    return folder / f"world-{key.world}-run-{key.run}.mcap"


class DecisionWriter:
    """Writer of decisions to an open recording. metadata: JSON values for /lme, besides the bearings of the beams."""

    def __init__(self, file: McapFile, metadata: Mapping[str, Any], robot: Robot) -> None:
        self._file, self._make = file, file.messages
        self._metadata, self._robot = metadata, robot
        self._has_begun = False

    def decision(self, observation: Observation, guidance: Guidance, time_ns: int) -> None:
        """Write the observation and the subgoal, at `time_ns`."""
        if not self._has_begun:
            self._begin(observation.scan, time_ns)
        self.motion(observation.odometry, observation.twist, time_ns)
        write, make = self._file.write, self._make
        target, subgoal = observation.target, guidance.subgoal
        write(
            "/goal", make.pose_stamped(time_ns, BASE, Pose(float(target[0]), float(target[1]), 0.0)), time_ns
        )
        write("/scan", make.scan(time_ns, LASER, observation.scan, self._robot.dt), time_ns)
        write("/subgoal", make.point(time_ns, BASE, float(subgoal[0]), float(subgoal[1])), time_ns)

    def motion(self, pose: Pose, twist: Twist, time_ns: int) -> None:
        """Write a pose and a twist."""
        self._file.write("/tf", self._make.transform(time_ns, ODOM, BASE, pose), time_ns)
        self._file.write("/odom", self._make.odometry(time_ns, ODOM, BASE, pose, twist), time_ns)

    def twist(self, topic: str, twist: Twist, time_ns: int) -> None:
        """Write a command."""
        self._file.write(topic, self._make.twist(twist), time_ns)

    def text(self, topic: str, text: str, time_ns: int) -> None:
        """Write a line of text."""
        self._file.write(topic, self._make.text(text), time_ns)

    def _begin(self, scan: LaserScan, time_ns: int) -> None:
        self._has_begun = True
        beams = {name: float(value) for name, value in scan._asdict().items() if name != "ranges"}
        self.text("/lme", json.dumps({**self._metadata, "version": lme.__version__, "scan": beams}), time_ns)
        mount = self._make.transform(time_ns, BASE, LASER, self._robot.lidar.mount)
        self._file.write("/tf_static", mount, time_ns)


class Recorder:
    """Writer of what the policy receives and decides while it drives; an `lme.navigation.episode.Observer`.

    Use as a context manager around one episode; see `McapFile` and `DecisionWriter`.
    """

    def __init__(self, path: Path, metadata: Mapping[str, Any], robot: Robot) -> None:
        self._file = McapFile(path, TOPICS, LATCHED, _ADVICE)
        self._metadata, self._robot = metadata, robot

    def __enter__(self) -> Self:
        self._writer = DecisionWriter(self._file.__enter__(), self._metadata, self._robot)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.__exit__(kind, error, trace)

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        """Write a control period: the observation, the subgoal and the command."""
        time_ns = round(state.time * _SECOND)
        self._writer.decision(observation, guidance, time_ns)
        self._writer.twist("/cmd_vel", command, time_ns)

    def ended(self, observation: Observation, state: State) -> None:
        """Write the final pose. No decision follows it, so there is no scan."""
        self._writer.motion(observation.odometry, observation.twist, round(state.time * _SECOND))
