"""Records a simulated episode as ROS 2 messages in an MCAP file, which Foxglove, RViz and `lme replay` open.

The package rosbags (extra `replay`) encodes the messages. The topic /lme carries, as JSON text, the values that no
other message holds exactly; for example, ROS stores the bearings of the beams as float32.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Mapping
from functools import cache
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np

import lme
from lme.errors import InputError
from lme.robots import Robot
from lme.sim.simulator import State
from lme.types import Guidance, LaserScan, Observation, Pose, Twist
from runners.config.extras import install
from runners.records.episode_record import EpisodeKey

FOLDER = "recordings"  # within a run's directory
TOPICS = {  # message types; the topics stand in the order in which a control period writes them
    "/lme": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/goal": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/subgoal": "geometry_msgs/msg/PointStamped",
    "/cmd_vel": "geometry_msgs/msg/Twist",
}
LATCHED = ("/lme", "/tf_static")  # written once; late subscribers receive them as well
ODOM, BASE, LASER = "odom", "base_link", "laser"

_ROSBAG2_VERSION: Final = 8  # 9 stores QoS profiles as words, which Humble cannot read (ros2/rosbag2#1476)
_SECOND = 1_000_000_000


def check_installed() -> None:
    """Raise InputError unless rosbags is installed, which writes the files."""
    try:
        import rosbags.rosbag2
        import rosbags.typesys  # noqa: F401
    except ImportError as error:
        raise InputError(f"record=mcap needs the package rosbags: {install('rosbags')}") from error


def recording_path(folder: Path, key: EpisodeKey) -> Path:
    """The file of one episode."""
    return folder / f"world-{key.world}-run-{key.run}.mcap"


class Recorder:
    """Writes what the policy receives and decides while it drives; an `lme.episode.Observer`.

    Use as a context manager around one episode. The file gets its name, and replaces an older one, when it is
    complete. If an exception ends the episode, no file is left. about: JSON values that /lme holds besides the
    bearings of the beams. Raises InputError where the file cannot be written.
    """

    def __init__(self, path: Path, about: Mapping[str, Any], robot: Robot) -> None:
        self._path = path
        self._partial = path.with_suffix(".partial")
        self._bag = self._partial / path.stem  # rosbags writes a folder, with a file of the same name in it
        self._about = about
        self._robot = robot

    def __enter__(self) -> Self:
        check_installed()
        from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

        self._messages = _Messages()
        self._begun = False
        try:
            shutil.rmtree(self._partial, ignore_errors=True)  # a killed run may have left it
            self._writer = Writer(self._bag, version=_ROSBAG2_VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            self._writer.open()
        except OSError as error:
            raise self._unwritable(error) from error
        self._connections = {topic: self._connect(topic) for topic in TOPICS}
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

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        """Write a control period: the observation, the subgoal and the command."""
        now = self._now(state)
        if not self._begun:
            self._begin(observation.scan, now)
        self._write_pose(observation, now)
        make = self._messages
        target, subgoal = observation.target, guidance.subgoal
        self._write("/goal", make.pose_stamped(now, BASE, Pose(float(target[0]), float(target[1]), 0.0)), now)
        self._write("/scan", make.scan(now, observation.scan, self._robot.dt), now)
        self._write("/subgoal", make.point(now, BASE, float(subgoal[0]), float(subgoal[1])), now)
        self._write("/cmd_vel", make.twist(command), now)

    def ended(self, observation: Observation, state: State) -> None:
        """Write the final pose. No decision follows it, so there is no scan."""
        self._write_pose(observation, self._now(state))

    def _begin(self, scan: LaserScan, now: int) -> None:
        self._begun = True
        beams = {name: float(value) for name, value in scan._asdict().items() if name != "ranges"}
        text = json.dumps({**self._about, "version": lme.__version__, "scan": beams})
        self._write("/lme", self._messages.text(text), now)
        self._write("/tf_static", self._messages.transform(now, BASE, LASER, self._robot.lidar.mount), now)

    def _write_pose(self, observation: Observation, now: int) -> None:
        make, pose = self._messages, observation.odometry
        self._write("/tf", make.transform(now, ODOM, BASE, pose), now)
        self._write("/odom", make.odometry(now, ODOM, BASE, pose, observation.twist), now)

    def _connect(self, topic: str) -> Any:
        store = self._messages.store
        qos = [_latched()] if topic in LATCHED else []
        return self._writer.add_connection(topic, TOPICS[topic], typestore=store, offered_qos_profiles=qos)

    def _write(self, topic: str, message: Any, now: int) -> None:
        data = self._messages.store.serialize_cdr(message, TOPICS[topic])
        try:
            self._writer.write(self._connections[topic], now, data)
        except OSError as error:
            raise self._unwritable(error) from error

    def _now(self, state: State) -> int:
        return round(state.time * _SECOND)

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(
            f"{self._path}: cannot be written ({error.strerror or error}): make room there and add resume=true, "
            "or choose another directory with hydra.run.dir=PATH"
        )


class _Messages:
    """Makes ROS messages. Stamps are in nanoseconds; names are those of the message definitions."""

    def __init__(self) -> None:
        self.store = _store()

    def text(self, data: str) -> Any:
        return self._make("std_msgs/msg/String", data)

    def scan(self, now: int, scan: LaserScan, period: float) -> Any:
        ranges = np.ascontiguousarray(scan.ranges, dtype=np.float32)
        angle_max = scan.angle_min + (len(ranges) - 1) * scan.angle_increment
        times = 0.0, period  # no time between beams; one sweep per control period
        return self._make(
            TOPICS["/scan"],
            self._header(now, LASER),
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
        return self._make(TOPICS["/odom"], self._header(now, frame), child, known, moving)

    def transform(self, now: int, frame: str, child: str, pose: Pose) -> Any:
        shift = self._make("geometry_msgs/msg/Vector3", pose.x, pose.y, 0.0)
        moved = self._make("geometry_msgs/msg/Transform", shift, self._quaternion(pose.yaw))
        stamped = self._make("geometry_msgs/msg/TransformStamped", self._header(now, frame), child, moved)
        return self._make(TOPICS["/tf"], [stamped])

    def pose_stamped(self, now: int, frame: str, pose: Pose) -> Any:
        return self._make(TOPICS["/goal"], self._header(now, frame), self._pose(pose))

    def point(self, now: int, frame: str, x: float, y: float) -> Any:
        point = self._make("geometry_msgs/msg/Point", x, y, 0.0)
        return self._make(TOPICS["/subgoal"], self._header(now, frame), point)

    def twist(self, twist: Twist) -> Any:
        linear = self._make("geometry_msgs/msg/Vector3", float(twist.v), 0.0, 0.0)
        angular = self._make("geometry_msgs/msg/Vector3", 0.0, 0.0, float(twist.omega))
        return self._make(TOPICS["/cmd_vel"], linear, angular)

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
    """(z, w) of the quaternion of a yaw in [−π, π] [rad], such that 2·atan2(z, w) equals the yaw exactly.

    z and w are sine and cosine of half the yaw, rounded up or down where rounding to nearest loses the last bit.
    """
    z, w = math.sin(yaw / 2), math.cos(yaw / 2)
    near = product(_and_neighbours(z), _and_neighbours(w))
    return next((pair for pair in near if 2.0 * math.atan2(*pair) == yaw), (z, w))


def _and_neighbours(value: float) -> tuple[float, float, float]:
    return value, math.nextafter(value, math.inf), math.nextafter(value, -math.inf)


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
