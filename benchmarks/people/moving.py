"""A recording of a robot that drives, with labels by hand, as in angusleigh/leg_tracker_benchmarks.

The labels are in the scanner's frame, on a topic of their own, and each follows the scan that it is of. As by their
authors, people and tracks are scored only in a sector of the scan.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.people.labels import SMOOTHED, WALKING, Labels, Recording, line, recording_of
from benchmarks.people.tracked import tracked
from lme.errors import InputError
from lme.geometry.frames import compose, to_robot, to_world
from lme.live.frames import FramesConfig
from lme.live.messages import SECOND, planar_matrix
from lme.perception.people.interface import Tracks
from lme.types import Bools, Floats, Pose
from runners.recordings.bags import Bag
from runners.recordings.posed_scans import PosedScan, PosedScans
from runners.recordings.recording import inspect
from runners.recordings.topics import BagTopicsConfig, choose

_LABELS = "/ground_truth_people_tracks"
_SECTOR = (math.radians(-80.0), math.radians(12.0))  # of the scan
_STALE = SECOND // 2  # [ns] from a scan to the nearest pose, as in `lme replay`


class Drive(NamedTuple):
    """A recording with poses of the scanner at every scan, by odometry.

    labels (L, 4): scan, person, x, y [m] in the scanner's frame.
    """

    recording: Recording
    poses: list[Pose]
    labels: Floats


def read_drive(path: Path) -> Drive:
    """Read a recording. Raises InputError if it cannot be read, or lacks labels, poses or the scanner's mount."""
    labels: list[tuple[int, Any]] = []
    posed_scans: list[PosedScan] = []
    with Bag(path) as bag:
        topics = choose(bag, BagTopicsConfig(), None)
        recording = inspect(bag, topics, FramesConfig(), "auto")
        if recording.mount is None:
            raise InputError(f"bag {path}: no transform from {recording.frames.base} to the scanner")
        scans = PosedScans(recording, _STALE)
        for message in bag.messages({*topics.names, _LABELS}):
            posed_scans += scans.ready(message)
            scans.take(message)
            if message.topic == _LABELS:
                labels.append((scans.scans - 1, message.content))
        posed_scans += scans.ready(None)
    if not labels:
        raise InputError(f"bag {path}: no labels: it has no messages on {_LABELS}")
    mount, _ = planar_matrix(recording.mount)
    table = [(scan, label.id, label.pose.position.x, label.pose.position.y) for scan, label in labels]
    scanner = [compose(_pose(label, path), mount) for label in posed_scans]
    return Drive(
        recording_of([label.message.content for label in posed_scans]), scanner, np.array(table, np.float64)
    )


def labels_of(drive: Drive) -> Labels:
    """The people of a drive. Who moves over ground and is in the sector is scored.

    A velocity is that of a straight line through the labels of a person in the half second before and after, in the
    frame of the odometry. Who was labelled only once in that time counts as standing.
    """
    scans, people = drive.labels[:, :2].astype(np.int64).T
    positions, times = drive.labels[:, 2:], drive.recording.times
    ground = np.array(
        [to_world(position, drive.poses[k]) for k, position in zip(scans, positions, strict=True)]
    )
    velocities = np.zeros_like(positions)
    for i, scan in enumerate(scans):
        neighbours = (people == people[i]) & (np.abs(scans - scan) <= SMOOTHED)
        if neighbours.sum() > 1:
            velocity = line(times[scans[neighbours]], ground[neighbours], times[scan])[1]
            velocities[i] = to_robot(velocity, Pose(0.0, 0.0, drive.poses[scan].yaw))
    walking = np.hypot(*velocities.T) >= WALKING
    return Labels(scans, people, positions, velocities, walking & _in_sector(positions))


def tracked_in_sector(drive: Drive) -> Iterator[tuple[Tracks, float]]:
    """As `tracked`, without the tracks outside the sector."""
    for tracks, spent in tracked(drive.recording, drive.poses):
        names, pedestrians, radius, age, covariance = tracks
        own = _in_sector(pedestrians[:, :2])
        yield Tracks(names[own], pedestrians[own], radius[own], age[own], covariance[own]), spent


def _in_sector(positions: Floats) -> Bools:
    """Which of the places (P, 2) count."""
    angles = np.arctan2(positions[:, 1], positions[:, 0])
    is_inside: Bools = (angles >= _SECTOR[0]) & (angles <= _SECTOR[1])
    return is_inside


def _pose(scan: PosedScan, path: Path) -> Pose:
    """Where the base was at a scan. Raises InputError if no pose is near in time."""
    if scan.motion is None:
        raise InputError(f"bag {path}: a scan has no pose within {_STALE / SECOND:g} s")
    return scan.motion.pose
