"""Labels of walking people in recordings of a scanner that stands still, by background subtraction.

What a beam sees in a good share of a recording is background; everything else is somebody. All scans are used, also
later ones, so the labels know more than a tracker can. The recordings are those of angusleigh/leg_tracker (BSD-3).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.optimize import linear_sum_assignment

from lme.types import Bools, Floats, Ints
from runners.recordings.bags import Bag

_SAME = 0.15  # [m] returns of a beam this near to each other are of the same surface
_BACKGROUND = 0.2  # share of the scans in which a beam sees a surface of the background
_APART = 0.4  # [m] the legs of one person are nearer to each other
_FEWEST_POINTS = 3  # of a person: two legs at 9 m
_GATE = 0.6  # [m] from where a person is expected to where they are
_LONGEST_GAP = 4  # scans without a person, for example behind another one
_SHORTEST = 8  # scans of a track that is scored; shorter ones are noise
SMOOTHED = 4  # scans before and after that place and velocity are fitted to; legs swing
_LEAST_WAY = 1.0  # [m] between the ends of a track's box; what stays is furniture or noise
WALKING = 0.3  # [m/s]


class Recording(NamedTuple):
    """The scans of a recording: times (T,) [s]; ranges (T, B) [m]; angle_min, increment [rad].

    A range is 0 without a return, and NaN if the measurement failed.
    """

    times: Floats
    ranges: Floats
    angle_min: float
    angle_increment: float
    range_max: float


class Labels(NamedTuple):
    """People by scan: (L,) scan, person; place (L, 2) [m], velocity (L, 2) [m/s] in the scanner's frame.

    walking: (L,) whether they are scored. The others stand, or are noise: to find them is neither right nor wrong.
    """

    scan: Ints
    person: Ints
    place: Floats
    velocity: Floats
    walking: Bools


def read(path: Path) -> Recording:
    """The scans of a ROS recording with one topic. Raises InputError if it cannot be read."""
    with Bag(path) as bag:
        return recording_of(
            [message.content for message in bag.messages([topic.name for topic in bag.topics()])]
        )


def recording_of(messages: Sequence[Any]) -> Recording:
    """The scans in messages of type LaserScan."""
    scan = messages[0]
    stamps = [m.header.stamp for m in messages]
    ranges = np.array([m.ranges for m in messages], dtype=np.float64)
    returned = np.isfinite(ranges) & (ranges > scan.range_min) & (ranges < scan.range_max)
    return Recording(
        np.array([s.sec - stamps[0].sec + 1e-9 * s.nanosec for s in stamps]),
        np.where(returned | np.isnan(ranges), ranges, 0.0),
        float(scan.angle_min),
        float(scan.angle_increment),
        float(scan.range_max),
    )


def labels(recording: Recording) -> Labels:
    """The people of a recording."""
    detections = [_clusters(points) for points in _foreground_points(recording)]
    tracks = _linked(detections, recording.times)
    rows = [_rows(person, np.array(track), recording.times) for person, track in enumerate(tracks)]
    table = np.vstack([np.empty((0, 7)), *rows])
    table = table[np.argsort(table[:, 0], kind="stable")]
    scan, person = table[:, :2].astype(np.int64).T
    return Labels(scan, person, table[:, 2:4], table[:, 4:6], table[:, 6] > 0.0)


def _foreground_points(recording: Recording) -> list[Floats]:
    """The points (P, 2) of every scan that are not background."""
    ranges, returned = recording.ranges, recording.ranges > 0.0
    share = np.ones(ranges.shape)
    for beam in range(ranges.shape[1]):
        own = ranges[returned[:, beam], beam]
        levels = np.sort(own)
        num_like = np.searchsorted(levels, own + _SAME) - np.searchsorted(levels, own - _SAME)
        share[returned[:, beam], beam] = num_like / len(ranges)
    angles = recording.angle_min + recording.angle_increment * np.arange(ranges.shape[1])
    xy = ranges[:, :, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return [
        points[own & (shares < _BACKGROUND)] for points, own, shares in zip(xy, returned, share, strict=True)
    ]


def _clusters(points: Floats) -> list[Floats]:
    """Middles (2,) of the groups of points: the mean of the legs' means, however many points each has."""
    if len(points) < _FEWEST_POINTS:
        return []
    links = linkage(points, "single")
    people, legs = (fcluster(links, apart, "distance") for apart in (_APART, _SAME))
    members = [people == n for n in np.unique(people)]
    return [
        np.mean([points[own & (legs == leg)].mean(axis=0) for leg in np.unique(legs[own])], axis=0)
        for own in members
        if own.sum() >= _FEWEST_POINTS
    ]


def _linked(detections: list[list[Floats]], times: Floats) -> list[list[tuple[int, float, float]]]:
    """Tracks of (scan, x, y): each detection goes to the nearest place where somebody is expected."""
    tracks: list[list[tuple[int, float, float]]] = []
    for scan, clusters in enumerate(detections):
        alive = [t for t in tracks if scan - t[-1][0] <= _LONGEST_GAP]
        expected = np.array([_expected(t, times, times[scan]) for t in alive]).reshape(-1, 2)
        positions = np.array(clusters).reshape(-1, 2)
        apart = np.linalg.norm(expected[:, None] - positions[None], axis=2)
        linked = set()
        for i, j in zip(*linear_sum_assignment(np.minimum(apart, 10.0 * _GATE)), strict=True):
            if apart[i, j] <= _GATE:
                alive[i].append((scan, *positions[j]))
                linked.add(j)
        tracks += [[(scan, *position)] for j, position in enumerate(positions) if j not in linked]
    return tracks


def _expected(track: list[tuple[int, float, float]], times: Floats, time: float) -> Floats:
    """Where a track goes on at its mean velocity over its last detections (2,)."""
    last = np.array(track[-SMOOTHED:])
    seconds = times[last[:, 0].astype(int)]
    if len(last) < 3:
        return last[-1, 1:]
    return line(seconds, last[:, 1:], time)[0]


def line(seconds: Floats, positions: Floats, time: float) -> tuple[Floats, Floats]:
    """Place (2,) and velocity (2,) at a time, by least squares."""
    design = np.column_stack([np.ones(len(seconds)), seconds - time])
    position, velocity = np.linalg.lstsq(design, positions, rcond=None)[0]
    return position, velocity


def _rows(person: int, track: Floats, times: Floats) -> Floats:
    """(n, 7) scan, person, x, y, vx, vy, walking of a track, smoothed."""
    scans = track[:, 0].astype(int)
    box = np.linalg.norm(np.ptp(track[:, 1:], axis=0))
    moves = len(track) >= _SHORTEST and box >= _LEAST_WAY
    rows = []
    for scan in scans:
        is_near = np.abs(scans - scan) <= SMOOTHED
        position, velocity = line(times[scans[is_near]], track[is_near, 1:], times[scan])
        rows.append((scan, person, *position, *velocity, moves and np.linalg.norm(velocity) >= WALKING))
    return np.array(rows, dtype=np.float64)
