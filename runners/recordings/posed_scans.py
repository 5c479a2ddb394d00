"""The messages of a recording in order of time, and its scans with the poses at their stamps."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, Self

from lme.config.presets import load_robot
from lme.errors import InputError, nearest, require
from lme.geometry.frames import compose
from lme.live.config import ScanConfig
from lme.live.frames import FramesConfig
from lme.live.messages import SECOND, frame, is_cloud
from lme.live.poses import Posture, StampedMotion, Track, imu_tilt
from lme.live.scan_source import ScanSource
from lme.live.twist_check import TwistCheck
from lme.robots import Robot
from lme.types import LaserScan, Pose
from runners.config.instantiate import fill_dataclass
from runners.recordings.bags import Bag, Message
from runners.recordings.recording import CLOCKS, RecordedPose, Recording, inspect, is_whole, open_recording
from runners.recordings.topics import BagTopicsConfig, Topics, choose

_JITTER = SECOND // 10  # messages up to this late are ignored: threads may swap them
_MAP_FRAME = "map"  # of poses that a localiser or a SLAM program has corrected
_STALE = SECOND // 2  # [ns] a scan is left out if no pose is this close in time
_PARTS = {"topics": BagTopicsConfig, "frames": FramesConfig, "scan": ScanConfig}
_SCALARS = ("start", "end", "clock")


class Order:
    """A check that the stamps of a topic increase."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._last: int | None = None

    def accepts(self, stamp: int) -> bool:
        """Return whether `stamp` [ns] is later than all before it. Raises InputError if time jumps back."""
        if self._last is not None and stamp < self._last - _JITTER:
            back = (self._last - stamp) / SECOND
            raise InputError(
                f"topics: the time of {self._topic} goes backwards by {back:.3g} s (stamp {stamp / SECOND:.3f} s): "
                "use clock=recorded, or cut the recording with start= and end="
            )
        is_later = self._last is None or stamp > self._last
        if is_later:
            self._last = stamp
        return is_later


class PosedScan(NamedTuple):
    """A message with a scan, and motion and posture of the base at its stamp; None if no pose is near in time.

    posture: also None for a LaserScan.
    """

    message: Message
    motion: StampedMotion | None
    posture: Posture | None = None


class PosedScans:
    """A queue of scans, each of which is returned once its pose is known. Messages come in recorded order.

    A scan waits for a later pose for at most `stale` [ns], which is also the largest difference between the stamps of
    a scan and of the nearest pose. due: whether a scan with this stamp [ns] is wanted. Scans from another frame,
    whose lidar is mounted elsewhere, and scans of fewer than two beams are left out with a warning.
    """

    def __init__(self, recording: Recording, stale: int, due: Callable[[int], bool] | None = None) -> None:
        self._recording, self._stale, self._due = recording, stale, due
        self._pose_order = Order(recording.topics.pose_name)
        self._scan_order = Order(recording.topics.scan.name)
        self._waiting: deque[tuple[Message, int]] = deque()
        self.tree, self.track = recording.tree.copy(), Track()
        self._twists, self._as_received = TwistCheck(), recording.bag.by_lme
        self.scans = 0  # seen so far, wanted or not
        self._frame = frame(recording.first_scan.content.header.frame_id)
        self._left_out: set[str] = set()  # kinds of scans that were warned of

    def take(self, message: Message) -> None:
        """Process a pose, a transform, an orientation or a scan; ignore any other message.

        Raises InputError if time goes backwards.
        """
        # A message of tf updates the transforms, and may also hold a pose.
        sample = self._recording.pose(message, self.tree)
        if sample is not None:
            if self._pose_order.accepts(sample.stamp):
                self.track.add(*sample)
                self._check_twist(sample)
        elif message.topic == self._recording.topics.imu_name:
            tilt = imu_tilt(message.content, self._recording.frames, self.tree)
            self.track.postures.add_imu(self._recording.stamp(message), tilt)
        elif message.topic == self._recording.topics.scan.name:
            stamp = self._recording.stamp(message)
            if self._is_usable(message) and self._scan_order.accepts(stamp):
                self.scans += 1
                if self._due is None or self._due(stamp):
                    self._waiting.append((message, stamp))

    def _check_twist(self, sample: RecordedPose) -> None:
        """Check the twist; once twists contradict the poses, velocities come from the slope of the poses."""
        if sample.twist is None or self._as_received:
            return
        self._twists.add(sample.stamp, sample.pose, sample.twist)
        contradiction = self._twists.contradiction()
        if contradiction is not None:
            self._recording.doubt_twists(contradiction)
            self.track.forget_twists()

    def _is_usable(self, message: Message) -> bool:
        came_from = frame(message.content.header.frame_id)
        reason = ""
        if came_from != self._frame:
            reason = f"scans from the frame {came_from}, not {self._frame} as most,"
        elif not is_whole(message):
            reason = "scans of less than two beams"
        if reason and reason not in self._left_out:
            self._left_out.add(reason)
            warnings.warn(f"{self._recording.topics.scan.name}: {reason} are left out", stacklevel=3)
        return not reason

    def ready(self, next_message: Message | None) -> Iterator[PosedScan]:
        """Yield the waiting scans that have a later pose, or that have waited longer than `stale` for one.

        next_message: None at the end. It must be recorded after the scan, so that every message recorded
        together with the scan has been processed.
        """
        # The oldest scan waits for a pose at or after its stamp, or until it has waited too long.
        while self._waiting:
            scan, stamp = self._waiting[0]
            if next_message is not None:
                newest = self.track.newest
                is_posed = newest is not None and newest >= stamp
                is_late = next_message.recorded > scan.recorded + self._stale
                if next_message.recorded <= scan.recorded or not (is_posed or is_late):
                    return
            self._waiting.popleft()
            posture = self.track.posture(stamp, self._stale) if is_cloud(scan.content) else None
            yield PosedScan(scan, self.track.at(stamp, self._stale), posture)


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
            self._bag.__exit__()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._bag.__exit__(*error)

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
