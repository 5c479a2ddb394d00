"""Tracks the people of a recording."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.people.labels import Recording
from lme.perception.people.interface import PeopleConfig, Tracks
from lme.perception.people.tracker import PeopleTracker
from lme.types import LaserScan, Pose

_PERIOD = 0.1332  # [s] of the scanner in the recordings
_RANGE_MIN = 0.03  # [m]
_HERE = Pose(0.0, 0.0, 0.0)


def tracked(recording: Recording, poses: Sequence[Pose] | None = None) -> Iterator[tuple[Tracks, float]]:
    """The tracks of every scan in the scanner's frame, and the processor time that they took [µs].

    poses: of the scanner at every scan, by odometry; without them it stands still.
    """
    tracker = PeopleTracker(PeopleConfig(), _HERE)
    angles = (recording.angle_min, recording.angle_increment)
    steps = np.diff(recording.times, prepend=recording.times[0] - _PERIOD)
    stations = [_HERE] * len(steps) if poses is None else poses
    for ranges, dt, pose in zip(recording.ranges, steps, stations, strict=True):
        scan = LaserScan(ranges.astype(np.float32), *angles, _RANGE_MIN, recording.range_max)
        start_ns = time.thread_time_ns()
        tracks = tracker.update(scan, pose, float(dt))
        yield tracks, (time.thread_time_ns() - start_ns) / 1000.0
