"""A tracker of people: from scans and odometry to places and velocities, without a network or a map.

Something has moved if it is where a beam of an earlier scan passed, and so has something that stood where a beam
passes now. Compact runs of points are followed from the first scan in which they appear, so that their velocity is
known as soon as there is evidence that they move. A track takes the points near its circle, so people who pass each
other or a wall stay apart. Every scan is registered on an earlier one, since a small error of the yaw moves
everything far away. Tracks and earlier scans are kept in a frame that the registered motion adds up to.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lme.geometry.frames import compose, relative
from lme.perception.people.interface import PeopleConfig, Tracks
from lme.perception.people.registration import (
    CELLS,
    NewestScan,
    flickered,
    moved_points,
    normals,
    recall,
    register,
    remember,
    unpacked,
    weigh,
)
from lme.perception.people.tracks import advance, new_table, predict, shown
from lme.perception.scan_points import beam_directions
from lme.types import Bools, Floats, Ints, LaserScan, Pose

_View = tuple[tuple[float, ...], Floats, Floats, tuple[float, float]]

_NOISES = 5.0  # standard deviations of a range that are not motion
_LAGS = (0.1, 0.2, 0.4, 0.8, 1.6)  # [s] ages of the scans that a scan is compared with
_SETTLED_AGE = 0.6  # [s] age from which on it is known which tracks of a scan move
_MEMORY = 5.0  # [s] points where something stood within this time stand
_KEY_AGE = 0.4  # [s] after which another scan becomes the one on which scans are registered
_NAMES = 4096  # tracks of which it is known whether they moved
_TRAVEL_ERROR, _TURN_ERROR = 0.1, 0.1  # shares of the odometry's motion: standard deviations of its errors
_YAW_ERROR = 0.3  # [rad/m] error of the yaw per distance, of wheels that slip
_STILL_ERROR = (0.002, 0.003)  # [m], [rad] errors that are added even at rest
_SETTLING = 0.05  # share of a new scan in the estimate of the noise
_SUSPECT = (2.5, 0.01)  # times the noise, and [m]: a scan that fits worse confirms no track
_LONGEST_STEP = 1.0  # [s] after a longer gap the tracker begins anew
_MAX_HIDDEN = 1.5  # periods for which a track that was not seen is still shown


class _Scan(NamedTuple):
    """A scan that is remembered.

    time [s]; lidar: its pose in the tracker's frame; base: by odometry; placed (B, 2): the points in the tracker's
    frame; owner (B,): see `NewestScan`; for the others see `unpacked`.
    """

    time: float
    lidar: Pose
    base: Pose
    points: Floats
    placed: Floats
    hits: Bools
    sure: Floats
    free: Floats
    owner: Ints


class PeopleTracker:
    """Tracker of people through one episode. mount: pose of the lidar in the base frame."""

    Config = PeopleConfig

    def __init__(self, config: PeopleConfig, mount: Pose) -> None:
        self._config, self._settings, self._mount = config, config.settings, mount
        self._geometry: tuple[float, ...] = ()
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._table, self._anchors = new_table()
        self._count = self._names = 0
        self._movers = np.zeros(_NAMES, np.bool_)
        self._stood = np.full((CELLS, CELLS), -math.inf, np.float32)
        self._newest_standing = -1.0  # time of the newest scan in it [s]
        self._key: tuple[_Scan, Floats] | None = None  # the scan to register others on, and its normals
        self._scans: deque[_Scan] = deque()
        self._time = 0.0
        self._noise = 0.01  # [m] of a range, estimated from the registration
        self._flicker = (0.0, 0.0)  # see `flickered`

    def update(self, scan: LaserScan, odometry: Pose, dt: float) -> Tracks:
        """Take in a scan and return the people in sight.

        odometry: of the base when the scan was taken; dt: since the scan before [s]. The same scan again (dt=0) gives
        the same tracks.
        """
        if self._scans and dt <= 0.0:
            return self._tracks(0.0)
        if dt > _LONGEST_STEP or (*scan[1:], len(scan.ranges)) != self._geometry:
            self.reset()
            self._geometry = (*scan[1:], len(scan.ranges))
            self._angles = (float(scan.angle_min), float(scan.angle_increment))
            self._guard = max(round(self._config.guard / self._angles[1]), 1)
        self._time += dt
        limits = (float(scan.range_min), float(scan.range_max))
        directions = beam_directions(*self._angles, len(scan.ranges))
        points, hits, sure, free = unpacked(
            scan.ranges, directions, limits, min(self._config.missing, limits[1]), self._guard
        )
        lidar = self._registered(points, hits, odometry)
        owner = np.full(len(hits), -1, np.int64)
        record = _Scan(self._time, lidar, odometry, points, _placed(points, lidar), hits, sure, free, owner)
        self._advance(record, dt)
        self._remember(record)
        return self._tracks(dt)

    def _registered(self, points: Floats, hits: Bools, odometry: Pose) -> Pose:
        """Register a scan, and return the lidar's pose in the tracker's frame."""
        self._trusted = True
        if self._key is None:
            return self._mount
        previous, (key, facing) = self._scans[-1], self._key
        travel = relative(compose(odometry, self._mount), compose(previous.base, self._mount))
        guess = relative(compose(previous.lidar, travel), key.lidar)
        distance, turn = math.hypot(travel.x, travel.y), abs(travel.yaw)
        along = _STILL_ERROR[0] + _TRAVEL_ERROR * distance
        spread = (along, along, _STILL_ERROR[1] + _YAW_ERROR * distance + _TURN_ERROR * turn)
        *motion, error = register(
            points, hits, key.points, facing, self._angles, (*guess,), spread, self._noise
        )
        self._trusted = math.isfinite(error) and error < _SUSPECT[0] * self._noise + _SUSPECT[1]
        if math.isfinite(error):
            self._noise += _SETTLING * (min(error, 0.05) - self._noise)
        return compose(key.lidar, Pose(*motion))

    def _advance(self, newest: _Scan, dt: float) -> None:
        """Bring the tracks up to a scan."""
        # Evidence of motion: the votes of earlier scans, except where something stood before.
        margin = max(self._config.margin, _NOISES * self._noise)
        votes = np.zeros((len(newest.placed), 2), np.int8)
        for past in self._compared():
            weigh(newest.placed, newest.hits, self._view(past), margin, votes)
        stands = recall(self._stood, newest.placed, newest.hits, self._time - _MEMORY)
        self._flicker = flickered(votes, stands, self._flicker)
        moved = moved_points(votes, stands, self._flicker)
        sight = NewestScan(newest.placed, newest.hits, moved, stands, newest.owner, self._movers)
        # Move the tracks on, then correct, begin and end them.
        predict(self._table, self._count, dt, self._config.acceleration)
        timing = (self._noise, margin, self._trusted, max(dt, 1e-3))
        tracks = self._table, self._anchors, self._count, self._names
        self._count, self._names = advance(*tracks, sight, self._view(newest), timing, self._settings)

    def _view(self, record: _Scan) -> _View:
        return (*record.lidar,), record.sure, record.free, self._angles

    def _compared(self) -> list[_Scan]:
        """Earlier scans of about the ages `_LAGS`, each once."""
        if not self._scans:
            return []
        scans = (min(self._scans, key=lambda scan: abs(self._time - scan.time - lag)) for lag in _LAGS)
        return list({scan.time: scan for scan in scans}.values())

    def _remember(self, newest: _Scan) -> None:
        """Remember the scan, and note what stood in those in which it is known by now which tracks move."""
        self._scans.append(newest)
        for past in self._scans:
            if self._newest_standing < past.time <= self._time - _SETTLED_AGE:
                remember(self._stood, past.placed, past.hits, past.owner, self._movers, past.time)
                self._newest_standing = past.time
        # Forget scans that are older than any that are compared with.
        while self._time - self._scans[0].time > _LAGS[-1] + 0.1:
            self._scans.popleft()
        # Register on a newer scan from now on, without the points of what moves.
        if self._key is None or self._time - self._key[0].time > _KEY_AGE - 0.01:
            moving = (newest.owner >= 0) & self._movers[newest.owner % len(self._movers)]
            self._key = newest, normals(newest.points, newest.hits & ~moving)

    def _tracks(self, dt: float) -> Tracks:
        """Tracks in the base frame of the newest scan."""
        newest = self._scans[-1]
        base = compose(newest.lidar, relative(Pose(0.0, 0.0, 0.0), self._mount))
        scan = (*newest.lidar,), newest.points, newest.hits, self._angles
        return shown(self._table[: self._count], _MAX_HIDDEN * dt, scan, base)


def _placed(points: Floats, lidar: Pose) -> Floats:
    """Transform points (B, 2) from the lidar's frame to the tracker's."""
    cos, sin = math.cos(lidar.yaw), math.sin(lidar.yaw)
    placed: Floats = points @ np.array([[cos, sin], [-sin, cos]]) + [lidar.x, lidar.y]
    return placed
