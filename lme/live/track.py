"""The motion of the robot: its pose, twist and posture at any time within the last seconds."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import NamedTuple

from lme.geometry.frames import between, relative
from lme.live.messages import SECOND, Tilt
from lme.live.poses import Posture, Postures
from lme.types import Pose, Twist

_KEPT = 5 * SECOND
_SLOPE = SECOND // 5  # interval over which velocity is computed from poses that have no twist
_TRIMMED_AT = 4096  # poses
_LEVEL = Tilt(0.0, 0.0)


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
