"""A recording, opened, and what a replay must know in advance: its clock, its frames, the mount of its lidar."""

from __future__ import annotations

import math
import statistics
import warnings
from collections import Counter
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from typing import NamedTuple

from lme.errors import InputError
from lme.live.frames import (
    Carrier,
    Frames,
    FramesConfig,
    TransformTree,
    carrier_of,
    message_frames,
    tf_frames,
)
from lme.live.messages import LASER_SCAN, ODOMETRY, SECOND, Tilt, frame, has_orientation, stamp_of
from lme.live.poses import is_sound, message_pose, moving_links, tf_pose
from lme.live.twist_check import TwistCheck
from lme.types import Floats, Pose, Twist
from runners.recordings.bags import Bag, Message
from runners.recordings.carmen import CarmenLog, is_carmen
from runners.recordings.topics import Topics, other_pose

CLOCKS = ("auto", "header", "recorded")
_LOOK_S = 10  # [s] of the recording to search for a transform to the lidar
_POSES_S = 120  # [s] of the recording in which poses are checked before it is read
_SCANS = 20  # used to measure the rate, and read in each part of the recording to find the usual scan
_PARTS = 4  # of the recording
_RARE = 0.1  # share of the scans below which a geometry is not that of the lidar
_TAIL_S = (2, 30)  # [s] at the end to search for the last pose, before the whole recording


class RecordedPose(NamedTuple):
    """A recorded pose: stamp [ns], pose of the base, twist if the message has one, height [m] and tilt of the base."""

    stamp: int
    pose: Pose
    twist: Twist | None
    height: float
    tilt: Tilt


@dataclass(slots=True)
class Recording:
    """A recording, its topics, and properties found in its first messages.

    frames: the odometry frame and the base frame. headers: whether stamps come from the headers. offset: clock of the
    file minus clock of the stamps [ns]. mount: (4, 4) from the scan's frame to the base frame; None if tf has none.
    carrier: of the scan's frame. scan_rate [Hz]. first_scan: the first one with the usual frame and geometry. tree:
    the transforms at the beginning. twists: whether the twists of odometry are used.
    """

    bag: Bag
    topics: Topics
    frames: Frames
    headers: bool
    offset: int
    mount: Floats | None
    carrier: Carrier
    scan_rate: float
    first_scan: Message
    tree: TransformTree
    twists: bool

    def stamp(self, message: Message) -> int:
        """Return the stamp of a message [ns]; without a header, its time of recording on the clock of the stamps."""
        header = getattr(message.content, "header", None)
        return stamp_of(header) if self.headers and header is not None else message.recorded - self.offset

    def seconds(self, stamp: int) -> float:
        """Return the time since the recording began [s]."""
        return (stamp + self.offset - self.bag.start) / SECOND

    def pose(self, message: Message, tree: TransformTree) -> RecordedPose | None:
        """Return the pose in a message, if any; poses with absurd numbers or without a heading are ignored.

        Transforms of a tf message are first added to `tree`.
        """
        # tf gives the pose only if no topic does.
        if message.topic in self.topics.tf:
            tree.update(message.content)
            stamped_pose = tf_pose(message.content, tree, self.frames) if self.topics.pose is None else None
        elif self.topics.pose is not None and message.topic == self.topics.pose.name:
            if not has_orientation(message.content, self.topics.pose.type):
                return None
            stamped_pose = message_pose(message.content, self.topics.pose.type)
            stamped_pose = stamped_pose if self.twists else stamped_pose._replace(twist=None)
        else:
            return None
        if stamped_pose is None or not is_sound(stamped_pose.pose, stamped_pose.twist):
            return None
        stamp = stamp_of(stamped_pose.header) if self.headers else message.recorded - self.offset
        return RecordedPose(stamp, *stamped_pose[1:])

    def doubt_twists(self, contradiction: str) -> None:
        """Stop using velocities of the odometry messages, and warn why."""
        self.twists = False
        warnings.warn(f"bag {self.bag.path}: {self.topics.pose_name}: {contradiction}", stacklevel=2)

    def check_poses(self) -> None:
        """Compare the first twists with their poses. Raises InputError if no pose has a heading.

        In a recording by lme, the twist is the one that the policy received, with its errors, so nothing is checked.
        """
        pose, check = self.topics.pose, TwistCheck()
        headings: list[bool] = []
        if pose is None or self.bag.by_lme:
            return
        # Read poses until a twist has contradicted them, or enough twists have agreed.
        for message in self.bag.messages({pose.name}, None, self.bag.start + _POSES_S * SECOND):
            headings.append(has_orientation(message.content, pose.type))
            if pose.type != ODOMETRY and headings[-1]:
                return
            if headings[-1]:
                sample = message_pose(message.content, pose.type)
                stamp = stamp_of(sample.header) if self.headers else message.recorded
                if self.twists and sample.twist is not None and is_sound(sample.pose, None):
                    check.add(stamp, sample.pose, sample.twist)
                if check.contradiction() or check.full:
                    break
        # A pose without any orientation cannot be used at all; a wrong twist can be left out.
        if headings and not any(headings):
            raise InputError(
                f"bag {self.bag.path}: {pose.name}: its quaternion is zero, so it does not say where the robot heads: "
                "record its orientation, or choose other poses with topics.pose"
            )
        contradiction = check.contradiction(at_end=True)
        if contradiction is not None:
            self.doubt_twists(contradiction)

    def last_pose(self, stop: int | None) -> Pose:
        """Return the last pose recorded before `stop` [ns]. Raises InputError if there is none."""
        end_stamp = self.bag.end + 1 if stop is None else stop
        # Look in the last seconds first, then farther back, then in the whole recording.
        names = set(self.topics.tf) if self.topics.pose is None else {self.topics.pose.name}
        for seconds in (*_TAIL_S, None):
            start = None if seconds is None else end_stamp - seconds * SECOND
            latest, tree = None, self.tree.copy()
            for message in self.bag.messages(names, start, stop):
                latest = self.pose(message, tree) or latest
            if latest is not None:
                return latest.pose
        odom, base = self.frames
        raise InputError(f"bag {self.bag.path}: no pose of {base} in {odom} to use as the goal")


def inspect(bag: Bag, topics: Topics, frames: FramesConfig, clock: str) -> Recording:
    """Read the beginning of a recording. Raises InputError if scans, poses or their frames are missing.

    Warns of twists that contradict the poses.
    """
    # Read the static transforms, which are few but may come late, then the first messages until they suffice.
    opening = _Beginning(topics)
    for message in bag.messages([name for name in topics.tf if name.endswith("tf_static")]):
        opening.tree.update(message.content)
    for message in bag.messages(topics.names):
        opening.take(message)
        if opening.complete and (message.recorded - bag.start > _LOOK_S * SECOND or opening.mounted(frames)):
            break
    if not opening.scans:
        raise InputError(f"bag {bag.path}: no scans: {topics.scan.name} has no messages")
    # tf does not connect the frames after all: take another topic of poses.
    if topics.pose is None and tf_frames(frames, opening.tree) is None:
        topics = topics._replace(pose=other_pose(bag, topics))
        return inspect(bag, topics, frames, clock)
    # Choose the frames and the clock, and measure the rate of the scans.
    names = opening.frames(frames)
    headers, offset = opening.clock(clock, names)
    stamps = [stamp_of(m.content.header) if headers else m.recorded for m in opening.scans]
    gaps = [b - a for a, b in pairwise(stamps) if b > a]
    rate = SECOND / statistics.median(gaps) if gaps else 0.0
    # Find the lidar's geometry and its mount.
    scan = _usual_scan(bag, topics, opening.scans)
    came_from = frame(scan.content.header.frame_id)
    mount = opening.tree.lookup(names.base, came_from)
    carrier = carrier_of(came_from, names, opening.tree)
    recording = Recording(
        bag, topics, names, headers, offset, mount, carrier, rate, scan, opening.tree, topics.measured_twists
    )
    recording.check_poses()
    return recording


def _usual_scan(bag: Bag, topics: Topics, scans_at_start: list[Message]) -> Message:
    """Return the first scan with the usual frame and geometry; the very first may be short, or of another lidar.

    Of the geometries that are not rare, it has the widest; among several equally wide, the most frequent.
    """
    if topics.scan.type != LASER_SCAN:
        return scans_at_start[0]
    # Sample scans from all parts of the recording, and keep those of the most frequent frame.
    scans = list(scans_at_start)
    for section in range(1, _PARTS):
        start = bag.start + section * (bag.end - bag.start) // _PARTS
        scans += islice(bag.messages([topics.scan.name], start), _SCANS)
    frames = Counter(frame(scan.content.header.frame_id) for scan in scans)
    frame_id = frames.most_common(1)[0][0]
    scans = [scan for scan in scans if frame(scan.content.header.frame_id) == frame_id and is_whole(scan)]
    # Choose the geometry: not rare, as wide as the widest up to two beams, and then the most frequent.
    counts = Counter(map(_geometry, scans))
    usual = [shape for shape, count in counts.items() if count >= _RARE * len(scans)] or list(counts)
    if not usual:
        return scans_at_start[0]
    widest = max(fov for _, _, fov in usual)
    as_wide = [shape for shape in usual if shape[2] >= widest - 2.0 * abs(shape[1])]
    geometry = max(as_wide or usual, key=lambda shape: counts[shape])
    return next(scan for scan in scans if _geometry(scan) == geometry)


def is_whole(scan: Message) -> bool:
    """Return whether a scan has at least two beams; true for every cloud."""
    ranges = getattr(scan.content, "ranges", None)
    return ranges is None or len(ranges) >= 2


def _geometry(scan: Message) -> tuple[int, float, float]:
    """Return number of beams, increment and field of view [rad] of a LaserScan."""
    number, increment = len(scan.content.ranges), float(scan.content.angle_increment)
    fov = min(number * abs(increment), math.tau)
    return number, increment, fov if math.isfinite(fov) else 0.0


class _Beginning:
    """The first messages of each kind."""

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self.scans: list[Message] = []
        self._pose: Message | None = None
        self._tf_ahead: dict[str, int] = {}  # [ns] clock of the file minus stamp, by child frame
        self.tree = TransformTree()

    def take(self, message: Message) -> None:
        """Keep the message if it is among the first of its kind."""
        pose = self._topics.pose
        if message.topic == self._topics.scan.name and len(self.scans) < _SCANS:
            self.scans.append(message)
        elif pose is not None and message.topic == pose.name and self._pose is None:
            self._pose = message
        elif message.topic in self._topics.tf:
            self.tree.update(message.content)
            for tf in message.content.transforms:
                self._tf_ahead[frame(tf.child_frame_id)] = message.recorded - stamp_of(tf.header)

    @property
    def complete(self) -> bool:
        """Return whether there are enough scans to measure their rate, and a pose if a topic provides poses."""
        return len(self.scans) == _SCANS and (self._topics.pose is None or self._pose is not None)

    def mounted(self, frames: FramesConfig) -> bool:
        """Return whether the transforms to the base and to the lidar are known."""
        if self._topics.pose is None and tf_frames(frames, self.tree) is None:
            return False
        return (
            self.tree.lookup(self.frames(frames).base, frame(self.scans[0].content.header.frame_id))
            is not None
        )

    def frames(self, frames: FramesConfig) -> Frames:
        """Return the names of the odometry frame and the base frame."""
        if self._topics.pose is None:
            frames_in_tf = tf_frames(frames, self.tree)
            assert frames_in_tf is not None
            return frames_in_tf
        return message_frames(frames, None if self._pose is None else self._pose.content, self.tree)

    def clock(self, requested: str, frames: Frames) -> tuple[bool, int]:
        """Return whether to use the headers' stamps, and the clock of the file minus that of the stamps [ns]."""
        if requested == "recorded":
            return False, 0
        offset = min(_ahead(message) for message in self.scans)
        stamped = all(stamp_of(message.content.header) for message in self.scans)
        # Some drivers do not set stamps; on some robots, the clocks of the computers differ.
        agrees = all(abs(ahead - offset) < SECOND for ahead in self._poses_ahead(frames))
        return (True, offset) if requested == "header" or (stamped and agrees) else (False, 0)

    def _poses_ahead(self, frames: Frames) -> list[int]:
        if self._topics.pose is not None:
            return [] if self._pose is None else [_ahead(self._pose)]
        links = sorted(moving_links(self.tree, frames))
        return [self._tf_ahead[name] for name in links if self._tf_ahead.get(name)][:1]


def _ahead(message: Message) -> int:
    """Return the clock of the file minus the stamp of a message [ns]."""
    return message.recorded - stamp_of(message.content.header)


def open_recording(path: Path) -> Bag:
    """Open a ROS recording or a CARMEN log, by its name. Raises InputError if it is neither, or cannot be read."""
    return CarmenLog(path) if is_carmen(path) else Bag(path)
