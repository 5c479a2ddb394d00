"""Joins the scans of a recording with the poses at their stamps."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

from lme.live.track import StampedMotion, Track
from lme.live.twist_check import TwistCheck
from runners.replay.bags import Message
from runners.replay.order import Order
from runners.replay.recording import RecordedPose, Recording


class PosedScan(NamedTuple):
    """A message with a scan, and the motion of the base at its stamp; None if no pose is near in time."""

    message: Message
    motion: StampedMotion | None


class PosedScans:
    """Takes messages in recorded order, and gives back each scan once its pose is known.

    A scan waits for a pose that is later than itself, at most `stale` [ns], which is also the largest difference
    between the stamps of a scan and of the nearest pose. due: whether a scan with this stamp [ns] is wanted.
    """

    def __init__(self, recording: Recording, stale: int, due: Callable[[int], bool] | None = None) -> None:
        self._recording, self._stale, self._due = recording, stale, due
        self._pose_order = Order(recording.topics.pose_name)
        self._scan_order = Order(recording.topics.scan.name)
        self._waiting: deque[tuple[Message, int]] = deque()
        self.tree, self.track = recording.tree.copy(), Track()
        self._twists, self._as_received = TwistCheck(), recording.bag.by_lme
        self.scans = 0  # seen so far, wanted or not

    def take(self, message: Message) -> None:
        """Process a pose, a transform or a scan; ignore any other message. Raises InputError if time goes backwards."""
        sample = self._recording.pose(message, self.tree)
        if sample is not None:
            if self._pose_order.accepts(sample.stamp):
                self.track.add(*sample)
                self._check_twist(sample)
        elif message.topic == self._recording.topics.scan.name:
            stamp = self._recording.stamp(message)
            if self._scan_order.accepts(stamp):
                self.scans += 1
                if self._due is None or self._due(stamp):
                    self._waiting.append((message, stamp))

    def _check_twist(self, sample: RecordedPose) -> None:
        """Take velocities from the slope of the poses, once the twists have contradicted it."""
        if sample.twist is None or self._as_received:
            return
        self._twists.add(sample.stamp, sample.pose, sample.twist)
        contradiction = self._twists.contradiction()
        if contradiction is not None:
            self._recording.doubt_twists(contradiction)
            self.track.forget_twists()

    def ready(self, coming: Message | None) -> Iterator[PosedScan]:
        """The waiting scans that have a later pose, or that have waited for one longer than `stale`.

        coming: the next message, None at the end. It must be recorded after the scan, so that every message
        recorded together with the scan has been processed.
        """
        while self._waiting:
            scan, stamp = self._waiting[0]
            if coming is not None:
                newest = self.track.newest
                known = newest is not None and newest >= stamp
                late = coming.recorded > scan.recorded + self._stale
                if coming.recorded <= scan.recorded or not (known or late):
                    return
            self._waiting.popleft()
            yield PosedScan(scan, self.track.at(stamp, self._stale))
