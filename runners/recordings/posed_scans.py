"""The messages of a recording in order of time, and its scans with the poses at their stamps."""

from __future__ import annotations

import warnings
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from lme.errors import InputError
from lme.live.messages import SECOND, frame, is_cloud
from lme.live.poses import Posture, StampedMotion, Track, imu_tilt
from lme.live.twist_check import TwistCheck
from runners.recordings.bags import Message
from runners.recordings.recording import RecordedPose, Recording, is_whole

_JITTER = SECOND // 10  # messages up to this late are ignored: threads may swap them


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
