"""Poses of the robot, from messages or tf: its motion over the last seconds, and the posture that levels clouds."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from typing import Any, NamedTuple

import numpy as np

from lme.geometry.frames import between, relative
from lme.live.frames import Frames, TransformTree
from lme.live.messages import (
    ODOMETRY,
    SECOND,
    Tilt,
    frame,
    imu_rotation,
    planar_matrix,
    pose_matrix,
    pose_of,
    tilt_of,
    twist_of,
)
from lme.types import Floats, Pose, Twist

FARTHEST = 1e9  # [m], [rad] larger numbers come from a fault
FASTEST = 50.0  # [m/s], [rad/s] likewise
TWISTS = (
    "measured",
    "poses",
)  # velocities come from the messages, as far as they have them, or from the poses
_CLOUD_WINDOW = SECOND // 4  # [ns] before and after the stamp of a cloud, whose points take about 0.1 s
_KEPT = 5 * SECOND
_TRIMMED_AT = 4096  # samples
_SLOPE = SECOND // 5  # interval over which velocity is computed from poses that have no twist
_LEVEL = Tilt(0.0, 0.0)
_PLANAR = 1e-6  # [rad] below this, roll and pitch are rounding
_UPRIGHT = math.radians(45.0)  # a robot that drives is tilted by less, an IMU that hangs upside down by more
_PATIENCE = SECOND  # [ns] for which poses may be planar before that is reported: an IMU may begin later
_NO_IMU = "its poses hold no roll and pitch, and no IMU is heard"
_NO_ORIENTATION = (
    "its poses hold no roll and pitch, and its IMU measures no orientation, as that of a Livox lidar"
)


class Sample(NamedTuple):
    """The pose of the base in the odometry frame, its header with the stamp, and the twist if the message has one.

    height [m], tilt: what the planar pose leaves out.
    """

    header: Any
    pose: Pose
    twist: Twist | None
    height: float
    tilt: Tilt


def is_sound(pose: Pose, twist: Twist | None) -> bool:
    """Return whether all numbers are finite and of a size that a robot can have."""
    is_near = all(abs(number) <= FARTHEST for number in pose)
    return is_near and all(abs(number) <= FASTEST for number in twist or ())


def message_pose(message: Any, kind: str) -> Sample:
    """The pose in a message of type `kind`: Odometry, a pose or a transform."""
    matrix = pose_matrix(message, kind)
    twist = twist_of(message, kind) if kind == ODOMETRY else None
    return Sample(message.header, pose_of(message, kind), twist, float(matrix[2, 3]), tilt_of(matrix))


def moving_links(tree: TransformTree, frames: Frames) -> set[str]:
    """The child frames whose transforms say where the base is now.

    The transform from the map to the odometry frame only corrects them. Its stamp may lie in the future: AMCL's does.
    """
    chain = tree.chain(*frames)
    return {name for name in chain if name == frames.base or not name.endswith("odom")}


def tf_pose(message: Any, tree: TransformTree, frames: Frames) -> Sample | None:
    """The pose of the base by tf, if the TFMessage says where it is now. `tree` already holds the message."""
    links = moving_links(tree, frames)
    link_transforms = [stamped for stamped in message.transforms if frame(stamped.child_frame_id) in links]
    matrix = tree.lookup(*frames) if link_transforms else None
    if matrix is None:
        return None
    pose = planar_matrix(matrix)[0]
    return Sample(link_transforms[-1].header, pose, None, float(matrix[2, 3]), tilt_of(matrix))


def imu_tilt(message: Any, frames: Frames, tree: TransformTree) -> Tilt | None:
    """Roll and pitch of the base by an Imu; None if that holds no orientation.

    An IMU that tf does not connect to the base is taken to have the axes of the base.
    """
    rotation = imu_rotation(message)
    to_base = tree.lookup(frames.base, frame(message.header.frame_id))
    if rotation is None:
        return None
    return tilt_of(rotation if to_base is None else rotation @ to_base[:3, :3].T)


class Posture(NamedTuple):
    """Pose, height and tilts of the base at the stamp of a cloud.

    pose, height [m]: in the odometry frame. tilts (K, 3): time after the stamp [s], roll and pitch [rad] of the base,
    around the stamp and in order; K is 0 if they are not known. problem: the reason for that; "" if there is none to
    report.
    """

    pose: Pose
    height: float
    tilts: Floats
    problem: str


class Postures:
    """Heights of the base, by its poses, and its tilts, by the poses or by an IMU while the poses are planar."""

    def __init__(self) -> None:
        self._poses, self._imu = _Samples(), _Samples()
        self._first_stamp: int | None = None  # stamp of the first pose [ns]
        self._imu_heard = False

    def add(self, stamp: int, height: float, tilt: Tilt) -> None:
        """Add height [m] and tilt of a pose. stamp [ns]."""
        self._first_stamp = stamp if self._first_stamp is None else self._first_stamp
        self._poses.add(stamp, height, tilt)

    def add_imu(self, stamp: int, tilt: Tilt | None) -> None:
        """Add the tilt of the base by an IMU; None if the message holds no orientation. stamp [ns]."""
        self._imu_heard = True
        if tilt is not None:
            self._imu.add(stamp, 0.0, tilt)

    def at(self, stamp: int, pose: Pose, tolerance: int) -> Posture:
        """The posture at `stamp` [ns], where the planar pose is `pose`. tolerance [ns]: to the nearest sample."""
        poses = self._poses.around(stamp, tolerance)
        height = float(np.interp(0.0, poses[:, 0], poses[:, 1])) if len(poses) else 0.0
        # The IMU counts until a pose has been tilted: planar poses say nothing about roll and pitch.
        by_imu = not self._poses.tilted
        tilts = (self._imu.around(stamp, tolerance) if by_imu else poses)[:, [0, 2, 3]]
        # Tilts that are not measured, not near in time or impossible are dropped, with the reason.
        problem = ""
        if by_imu and not self._imu.tilted:
            tilts = tilts[:0]
            if self._first_stamp is not None and stamp - self._first_stamp >= _PATIENCE:
                problem = _NO_ORIENTATION if self._imu_heard else _NO_IMU
        elif not len(tilts):
            problem = "no orientation is near in time"
        elif (lean := np.arccos(np.cos(tilts[:, 1]) * np.cos(tilts[:, 2])).max()) > _UPRIGHT:
            tilts = tilts[:0]
            source = "its IMU says, whose frame tf must connect to the base" if by_imu else "its poses say"
            problem = f"it cannot be tilted by {math.degrees(lean):.0f}°, as {source}"
        return Posture(pose, height, tilts, problem)


class _Samples:
    """Heights [m], rolls and pitches [rad] in the order of their stamps [ns]. tilted: whether any is not level."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._values: list[tuple[float, float, float]] = []
        self.tilted = False

    def add(self, stamp: int, height: float, tilt: Tilt) -> None:
        if self._stamps and stamp <= self._stamps[-1]:
            return
        self._stamps.append(stamp)
        self._values.append((height, *tilt))
        self.tilted = self.tilted or max(map(abs, tilt)) > _PLANAR
        if len(self._stamps) > _TRIMMED_AT:
            first = bisect_left(self._stamps, stamp - _KEPT)
            del self._stamps[:first], self._values[:first]

    def around(self, stamp: int, tolerance: int) -> Floats:
        """(K, 4): time after `stamp` [s], height, roll, pitch. K is 0 if none is within `tolerance` [ns]."""
        start = max(bisect_right(self._stamps, stamp - _CLOUD_WINDOW) - 1, 0)
        stop = bisect_left(self._stamps, stamp + _CLOUD_WINDOW) + 1
        stamps, values = self._stamps[start:stop], self._values[start:stop]
        if not any(abs(sample_stamp - stamp) <= tolerance for sample_stamp in stamps):
            return np.empty((0, 4))
        times = [(sample_stamp - stamp) / SECOND for sample_stamp in stamps]
        return np.column_stack((times, np.array(values)))


class StampedMotion(NamedTuple):
    """Pose in the odometry frame and twist in the robot frame, at `stamp` [ns]."""

    stamp: int
    pose: Pose
    twist: Twist


class Track:
    """A record of poses that interpolates between them. postures: their heights and tilts."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._poses: list[Pose] = []
        self._twists: list[Twist | None] = []
        self.postures = Postures()

    def add(
        self, stamp: int, pose: Pose, twist: Twist | None, height: float = 0.0, tilt: Tilt = _LEVEL
    ) -> None:
        """Add a pose, unless a later one is known. Without a twist, the velocity is the slope of the poses."""
        if self._stamps and stamp <= self._stamps[-1]:
            return
        self.postures.add(stamp, height, tilt)
        self._stamps.append(stamp)
        self._poses.append(pose)
        self._twists.append(twist)
        if len(self._stamps) > _TRIMMED_AT:
            # Drop what is older than `_KEPT`.
            first = bisect_left(self._stamps, self._stamps[-1] - _KEPT)
            del self._stamps[:first], self._poses[:first], self._twists[:first]

    def forget_twists(self) -> None:
        """Take the velocity at the poses so far from their slope."""
        self._twists = [None] * len(self._twists)

    @property
    def newest(self) -> int | None:
        """Stamp of the last pose [ns]; None if there is none."""
        return self._stamps[-1] if self._stamps else None

    @property
    def latest(self) -> StampedMotion | None:
        """The motion at the last pose; None if there is none."""
        return self.at(self._stamps[-1], 0) if self._stamps else None

    def at(self, stamp: int, tolerance: int) -> StampedMotion | None:
        """The motion at `stamp` [ns], exactly as received if a pose has this stamp, else interpolated.

        Before the first pose it is the first motion, after the last pose the last motion. None if no pose is within
        `tolerance` [ns].
        """
        if not self._stamps:
            return None
        k = bisect_left(self._stamps, stamp)
        if k < len(self._stamps) and self._stamps[k] == stamp:
            return StampedMotion(stamp, self._poses[k], self._twist(k))
        if 0 < k < len(self._stamps):
            gap = min(stamp - self._stamps[k - 1], self._stamps[k] - stamp)
            return self._between(k, stamp) if gap <= tolerance else None
        end = k - 1 if k else 0
        if abs(self._stamps[end] - stamp) > tolerance:
            return None
        return StampedMotion(stamp, self._poses[end], self._twist(end))

    def posture(self, stamp: int, tolerance: int) -> Posture | None:
        """Posture of the base at `stamp` [ns]; None if no pose is within `tolerance` [ns]."""
        motion = self.at(stamp, tolerance)
        return None if motion is None else self.postures.at(stamp, motion.pose, tolerance)

    def _between(self, k: int, stamp: int) -> StampedMotion:
        a, b = self._poses[k - 1], self._poses[k]
        fraction = (stamp - self._stamps[k - 1]) / (self._stamps[k] - self._stamps[k - 1])
        (v, omega), (v_end, omega_end) = self._twist(k - 1), self._twist(k)
        twist = Twist(v + fraction * (v_end - v), omega + fraction * (omega_end - omega))
        return StampedMotion(stamp, between(a, b, fraction), twist)

    def _twist(self, k: int) -> Twist:
        """The twist that came with the pose, or the slope of the poses over the last fifth of a second."""
        twist = self._twists[k]
        if twist is not None:
            return twist
        j = max(bisect_right(self._stamps, self._stamps[k] - _SLOPE) - 1, 0)
        seconds = (self._stamps[k] - self._stamps[j]) / SECOND
        if seconds <= 0.0:
            return Twist(0.0, 0.0)
        motion = relative(self._poses[k], self._poses[j])
        return Twist(motion.x / seconds, motion.yaw / seconds)
