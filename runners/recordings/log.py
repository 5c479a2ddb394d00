"""The scans of a log, each with the pose of its lidar and of the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self

from lme.config.presets import load_robot
from lme.errors import InputError, nearest, require
from lme.geometry.frames import compose
from lme.live.config import ScanConfig
from lme.live.frames import FramesConfig
from lme.live.messages import SECOND, is_cloud
from lme.live.poses import Posture
from lme.live.scan_source import ScanSource
from lme.robots import Robot
from lme.types import LaserScan, Pose
from runners.config.instantiate import fill_dataclass
from runners.recordings.bags import Bag, Message
from runners.recordings.posed_scans import PosedScans
from runners.recordings.recording import CLOCKS, Recording, inspect, open_recording
from runners.recordings.topics import BagTopicsConfig, Topics, choose

_MAP_FRAME = "map"  # of poses that a localiser or a SLAM program has corrected
_STALE = SECOND // 2  # [ns] a scan is left out if no pose is this close in time
_PARTS = {"topics": BagTopicsConfig, "frames": FramesConfig, "scan": ScanConfig}
_SCALARS = ("start", "end", "clock")


class LocatedScan(NamedTuple):
    """A scan in its own geometry, as if the lidar were upright.

    lidar, base: poses in the frame of the map. sees_far: whether a range without a return means free space.
    """

    scan: LaserScan
    lidar: Pose
    base: Pose
    sees_far: bool


@dataclass(slots=True)
class LogConfig:
    """Keys of `lme replay` that say how to read a log. robot: its lidar's mount is used if the log has none."""

    topics: BagTopicsConfig = field(default_factory=BagTopicsConfig)
    frames: FramesConfig = field(default_factory=FramesConfig)
    scan: ScanConfig = field(default_factory=ScanConfig)
    start: float = 0.0  # [s] from the beginning of the log
    end: float | None = None  # [s]; None: its end
    clock: str = "auto"
    robot: str | None = None  # None: the lidar is at the middle of the robot

    def __post_init__(self) -> None:
        require("start", self.start, at_least=0.0)
        if self.end is not None:
            require("end", self.end, above=self.start)
        if self.clock not in CLOCKS:
            raise InputError(f"clock is {self.clock}: must be one of {', '.join(CLOCKS)}")


def log_config(values: Mapping[str, Any], robot: str | None) -> LogConfig:
    """Return the config with the `values`, as in `conf/replay.yaml`.

    Raises InputError for a wrong key or value.
    """
    keys = (*_PARTS, *_SCALARS)
    for key in values:
        if key not in keys:
            raise InputError(f"{key} is unknown: {nearest(key, keys)}must be one of {', '.join(keys)}")
    nested: dict[str, Any] = {key: fill_dataclass(_PARTS[key], values.get(key) or {}, key) for key in _PARTS}
    for key in _SCALARS[:2]:
        value = values.get(key)
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise InputError(f"{key} is {value!r}: must be a number of seconds")
    scalars = {key: values[key] for key in _SCALARS if values.get(key) is not None}
    return LogConfig(**nested, **scalars, robot=robot)


class DriveLog:
    """An open log; use as a context manager."""

    def __init__(self, path: Path, config: LogConfig) -> None:
        """Open a log. Raises InputError if it cannot be read, or has no scans or no poses."""
        self._bag, self._config = open_recording(path), config
        try:
            self._recording = _inspected(self._bag, config)
        except InputError:
            self._bag.__exit__(None, None, None)
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bag.__exit__(kind, error, trace)

    @property
    def sources(self) -> str:
        """Return a description of where scans and poses come from."""
        topics, frames = self._recording.topics, self._recording.frames
        return f"scans {topics.scan.name}, poses {topics.pose_name} ({frames.odom} to {frames.base})"

    @property
    def num_scans(self) -> int:
        """The number of scans in the whole log."""
        name = self._recording.topics.scan.name
        return next(topic.number for topic in self._bag.topics() if topic.name == name)

    def scans(self) -> Iterator[LocatedScan | None]:
        """Yield every scan between start and end; None for a scan without a pose.

        Raises InputError if time goes backwards.
        """
        recording = self._recording
        source = ScanSource(
            self._config.scan,
            recording.first_scan.content,
            recording.mount,
            _robot(self._config.robot),
            recording.carrier,
        )
        posed = PosedScans(recording, _STALE)
        # A scan is ready once the message after it is known; at the end, all that wait are.
        for next_message in self._messages():
            for message, motion, posture in posed.ready(next_message):
                yield None if motion is None else _located(source, message.content, motion.pose, posture)
            if next_message is not None:
                posed.take(next_message)

    def _messages(self) -> Iterator[Message | None]:
        """Yield the messages of the chosen part, and None after the last."""
        bag, config = self._bag, self._config
        start = bag.start + round(config.start * SECOND)
        stop = None if config.end is None else bag.start + round(config.end * SECOND)
        yield from bag.messages(self._recording.topics.names, start, stop)
        yield None


def _inspected(bag: Bag, config: LogConfig) -> Recording:
    """Return the recording, with poses in the map frame if tf has them and no other poses are requested."""
    topics = choose(bag, config.topics, None)
    if config.topics.pose is None and config.frames.odom is None and topics.tf:
        recording = _in_map_frame(bag, topics, config)
        if recording is not None:
            return recording
    return inspect(bag, topics, config.frames, config.clock)


def _in_map_frame(bag: Bag, topics: Topics, config: LogConfig) -> Recording | None:
    frames = FramesConfig(_MAP_FRAME, config.frames.base)
    with suppress(InputError):  # inspecting without these frames reports the error
        recording = inspect(bag, topics._replace(pose=None), frames, config.clock)
        if recording.topics.pose is None:
            return recording
    return None


def _robot(name: str | None) -> Robot:
    """Return the robot of this name; without a name, a stand-in whose lidar is at its middle."""
    robot = load_robot(name or "turtlebot2")
    return robot if name else replace(robot, lidar=replace(robot.lidar, x=0.0, y=0.0, yaw=0.0))


def _located(source: ScanSource, message: Any, base: Pose, posture: Posture | None) -> LocatedScan:
    scan = source.raw(message, posture)
    source.warn_of_faults(message, scan, posture)
    if source.upside_down:  # then the bearings are reversed
        scan = scan._replace(angle_min=-scan.angle_min, angle_increment=-scan.angle_increment)
    return LocatedScan(scan, compose(base, source.mount), base, not is_cloud(message))
