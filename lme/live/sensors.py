"""The latest scan, motion and transforms, from messages that may arrive late, out of order or not at all."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np

from lme.live.config import LiveConfig
from lme.live.frames import (
    Carrier,
    Frames,
    FramesConfig,
    TransformTree,
    carrier_of,
    message_frames,
    tf_frames,
)
from lme.live.messages import (
    SECOND,
    frame,
    has_orientation,
    is_cloud,
    is_empty,
    kind_of_pose,
    matrix_of,
    stamp_of,
)
from lme.live.poses import Posture, Sample, StampedMotion, Track, imu_tilt, is_sound, message_pose, tf_pose
from lme.live.step import NotReadyError
from lme.live.twist_check import TwistCheck
from lme.types import Floats

_NAMES = {"scan": "scan", "pose": "odometry"}


class LiveSight(NamedTuple):
    """The sensor data for a decision. scan: the latest message. motion: that at its stamp. newest: the latest motion.

    posture: posture of the base at the stamp of a cloud; None for a LaserScan.
    """

    scan: Any
    motion: StampedMotion
    newest: StampedMotion
    posture: Posture | None = None


class LiveSensors:
    """The latest messages, with checks that they are fresh enough to drive on.

    A message counts if its stamp is within `stale` of its arrival, and later than those before it.
    Poses come from tf until the first message that holds one; from then on, only from such messages.
    measured_twists: whether the twists of these messages count.
    """

    def __init__(self, config: LiveConfig, frames: FramesConfig, measured_twists: bool = True) -> None:
        self._stale = round(config.stale * SECOND)
        self._by_header = config.clock == "header"
        self._config = frames
        self._believes_twists = measured_twists
        self._pose_message: Any = None
        self._tf_frames: Frames | None = None
        self._moving: set[str] = set()  # child frames whose transforms come on tf, not only on tf_static
        self.tree = TransformTree()
        self.forget()

    def forget(self) -> None:
        """Drop scans and poses. Transforms stay, because static ones come only once; moving ones must come again."""
        self.scan: Any = None
        self.track, self._twists = Track(), TwistCheck()
        # Stamp or arrival, whichever is earlier [ns], by kind of message, and of moving transforms by child frame.
        self._last_stamps: dict[str, int] = {}
        self._moving_stamps: dict[str, int] = {}
        self._scan_stamp = 0
        self._problems: dict[str, str] = {}

    def note_problem(self, kind: str, problem: str) -> None:
        """Note why the last message was ignored. kind: scan, pose or tf."""
        self._problems[kind] = problem

    def take_scan(self, message: Any, now_ns: int) -> None:
        """Keep a LaserScan or PointCloud2, unless a later one is known."""
        stamp = self._stamp("scan", message.header, now_ns)
        if stamp is None or (self.scan is not None and stamp <= self._scan_stamp):
            return
        self.scan, self._scan_stamp = message, stamp
        self._note("scan", stamp, now_ns)

    def take_pose(self, message: Any, now_ns: int) -> None:
        """Add an Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped."""
        kind = kind_of_pose(message)
        sample = message_pose(message, kind)
        if not has_orientation(message, kind):
            self.note_problem("pose", "its quaternion is zero")
            return
        if self._pose_message is None:
            self.track = Track()  # until now, poses came from tf
        self._pose_message = message
        self._add(sample, now_ns)

    def take_imu(self, message: Any, now_ns: int) -> None:
        """Add an Imu."""
        stamp = self._stamp("imu", message.header, now_ns)
        if stamp is not None:
            self.track.postures.add_imu(stamp, imu_tilt(message, self.frames, self.tree))

    def take_transforms(self, message: Any, now_ns: int, static: bool) -> None:
        """Add a TFMessage."""
        for stamped in message.transforms:
            if not np.isfinite(matrix_of(stamped.transform.translation, stamped.transform.rotation)).all():
                self.note_problem("tf", f"the transform of {frame(stamped.child_frame_id)} is not finite")
                return
        self._problems.pop("tf", None)
        self.tree.update(message)
        if not static:
            for stamped in message.transforms:
                child, stamp = frame(stamped.child_frame_id), self._header_stamp(stamped.header) or now_ns
                self._moving_stamps[child] = max(min(stamp, now_ns), self._moving_stamps.get(child, 0))
            self._moving |= {*self._moving_stamps}
        if self._pose_message is None:
            # Without a topic of poses, tf gives them. Other frames begin a new track.
            frames = tf_frames(self._config, self.tree)
            if frames != self._tf_frames:
                self._tf_frames, self.track = frames, Track()
            sample = None if frames is None else tf_pose(message, self.tree, frames)
            if sample is not None:
                self._add(sample, now_ns)

    @property
    def frames(self) -> Frames:
        """The odometry frame and the base frame."""
        by_tf = self._tf_frames if self._pose_message is None else None
        return by_tf or message_frames(self._config, self._pose_message, self.tree)

    @property
    def mount(self) -> Floats | None:
        """(4, 4) from the frame of the scan to the base frame; None if there is no scan or tf does not connect them."""
        if self.scan is None:
            return None
        return self.tree.lookup(self.frames.base, frame(self.scan.header.frame_id))

    @property
    def carrier(self) -> Carrier:
        """The carrier of the frame of the scan, if that is a cloud; nothing depends on it for a LaserScan."""
        if not is_cloud(self.scan):
            return Carrier.BASE
        return carrier_of(frame(self.scan.header.frame_id), self.frames, self.tree)

    @property
    def posture(self) -> Posture | None:
        """Posture of the base at the stamp of the scan, if that is a cloud; None without a pose close in time."""
        return self.track.posture(self._scan_stamp, self._stale) if is_cloud(self.scan) else None

    def look(self, now_ns: int) -> LiveSight:
        """Return the sensor data at `now_ns`. Raises NotReadyError if something is missing, stale or empty."""
        self._check("scan", now_ns)
        if is_empty(self.scan):
            raise NotReadyError("the scan is empty: no beam measures anything")
        self._check("pose", now_ns)
        motion, newest = self.track.at(self._scan_stamp, self._stale), self.track.latest
        if motion is None or newest is None:
            raise NotReadyError("no odometry close in time to the scan")
        return LiveSight(self.scan, motion, newest, self.posture)

    def check_transforms(self, names: set[str], now_ns: int) -> None:
        """Raise NotReadyError if one of these frames moves and its transform is stale."""
        for name in sorted(names & self._moving):
            if name not in self._moving_stamps:
                raise NotReadyError(f"no transform of {name}")
            if now_ns - self._moving_stamps[name] > self._stale:
                raise NotReadyError(f"the transform of {name} is older than {_seconds(self._stale)}")

    def _add(self, sample: Sample, now_ns: int) -> None:
        stamp = self._stamp("pose", sample.header, now_ns)
        if stamp is None:
            return
        if not is_sound(sample.pose, sample.twist):
            self.note_problem("pose", "it is not finite, or absurdly large")
            return
        if self.track.newest is None or stamp > self.track.newest:
            twist = sample.twist if self._believes_twists else None
            self.track.add(stamp, sample.pose, twist, sample.height, sample.tilt)
            self._check_twist(stamp, sample)
            self._note("pose", stamp, now_ns)

    def _check_twist(self, stamp: int, sample: Sample) -> None:
        """Take velocities from the slope of the poses, once the twists have contradicted it."""
        if sample.twist is None or not self._believes_twists:
            return
        self._twists.add(stamp, sample.pose, sample.twist)
        contradiction = self._twists.contradiction()
        if contradiction is not None:
            self._believes_twists = False
            self.track.forget_twists()
            warnings.warn(
                f"odometry of {self.frames.base} in {self.frames.odom}: {contradiction}", stacklevel=2
            )

    def _stamp(self, kind: str, header: Any, now_ns: int) -> int | None:
        """The stamp of a message that arrives at `now_ns`; None if it is too far from that time."""
        stamp = self._header_stamp(header)
        if stamp and abs(now_ns - stamp) > self._stale:
            side = "behind" if now_ns > stamp else "ahead of"
            self.note_problem(
                kind,
                f"its stamp is {_seconds(abs(now_ns - stamp))} {side} the clock; set live.clock=received if "
                "clocks differ",
            )
            return None
        return stamp or now_ns

    def _header_stamp(self, header: Any) -> int:
        """The stamp of a header [ns]; 0 if there is none, or if message stamps are ignored."""
        return stamp_of(header) if self._by_header else 0

    def _note(self, kind: str, stamp: int, now_ns: int) -> None:
        self._last_stamps[kind] = min(stamp, now_ns)
        self._problems.pop(kind, None)

    def _check(self, kind: str, now_ns: int) -> None:
        problem = self._problems.get(kind)
        if kind == "pose" and self._pose_message is None:
            problem = problem or self._problems.get("tf")
        reason = f" ({problem})" if problem else ""
        if kind not in self._last_stamps:
            raise NotReadyError(f"no {_NAMES[kind]}{reason}")
        if now_ns - self._last_stamps[kind] > self._stale:
            raise NotReadyError(f"the {_NAMES[kind]} is older than {_seconds(self._stale)}{reason}")


def _seconds(time: int) -> str:
    seconds = time / SECOND
    return f"{seconds:.1f} s" if seconds < 10.0 else f"{seconds:.0f} s"
