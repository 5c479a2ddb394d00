"""Observation of the DRL-VO network: ten pooled lidar sweeps, and maps of the pedestrians' velocities."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lme.planners.drl_vo.weights import IMAGE, SIDE
from lme.types import Bools, Floats, Ints, LaserScan, Pose

BINS = SIDE  # of a sweep
SWEEPS = 10
_TILES = SIDE // (2 * SWEEPS)  # how often the rows of all sweeps repeat in the image
_CELL, _AHEAD, _ASIDE = 0.25, 20.0, 10.0  # [m] size of a map's cell, and extent of the maps
_FASTEST = 2.0  # [m/s] that a map shows as 1
_FRONT = math.pi / 4  # [rad] to each side of straight ahead
_EDGE = 1e-6  # [rad] a beam on the edge of two bins belongs to the left one, whatever the rounding


@dataclass(frozen=True)
class Outlines:
    """Outlines of this robot and of the one that the network was trained on, as seen from their lidars.

    box (half_length, half_width, rounding) [m]: this robot's footprint; mount: that of its lidar. ahead, aside:
    distance from the trained robot's lidar to its outline [m], straight ahead and at `fov` / 2 [rad], linear between.
    Source: branch barn_2023 of the authors' entry.
    """

    box: tuple[float, float, float]
    mount: Pose
    ahead: float
    aside: float
    fov: float

    def change(self, bearings: Floats) -> Floats:
        """Distance from the lidar to the outline along each beam, the trained robot's less this one's: (B,) [m].

        bearings: (B,) of beams in the robot frame [rad].
        """
        half_length, half_width, rounding = self.box
        cos, sin = np.cos(bearings), np.sin(bearings)
        if rounding > 0.0:
            along, across = self.mount.x * cos + self.mount.y * sin, self.mount.y * cos - self.mount.x * sin
            own = np.sqrt(np.maximum(rounding**2 - across**2, 0.0)) - along
        else:
            with np.errstate(divide="ignore", over="ignore"):  # a beam along a side meets it at infinity
                to_end = (half_length - self.mount.x * np.sign(cos)) / np.abs(cos)
                to_side = (half_width - self.mount.y * np.sign(sin)) / np.abs(sin)
            own = np.minimum(to_end, to_side)
        share = np.minimum(np.abs(bearings) / (self.fov / 2), 1.0)
        return self.ahead + (self.aside - self.ahead) * share - np.maximum(own, 0.0)


class Sweeps:
    """Pooled sweeps of the last half second.

    fov: angle that the bins divide [rad], centred straight ahead. range_max: longer ranges become this one [m].
    no_return: range of a beam without return, and of a bin without beams [m]. A sweep that is due between two
    scans is the earlier scan, as in the authors' node. Sweeps before the first scan equal it. outlines: each
    range is changed so that the obstacle is as far from the trained robot as it is from this one; None: unchanged.
    """

    def __init__(
        self,
        fov: float,
        range_max: float,
        no_return: float,
        rates: tuple[float, float],
        outlines: Outlines | None = None,
    ) -> None:
        """rates: of the incoming scans and of the sweeps [Hz]."""
        self._fov, self._range_max, self._no_return, self._outlines = fov, range_max, no_return, outlines
        scan_rate, sweep_rate = rates
        ages = [math.ceil(k * scan_rate / sweep_rate - 1e-9) for k in reversed(range(SWEEPS))]
        self._ages, self._kept = ages, ages[0] + 1  # of the sweeps, in scans, from the oldest
        self._pooled: deque[Floats] = deque(maxlen=self._kept)  # the newest first

    def clear(self) -> None:
        """Forget all sweeps."""
        self._pooled.clear()

    def add(self, scan: LaserScan, mount_yaw: float) -> None:
        """Pool a scan: the least and the mean range in each bin, from the right to the left."""
        geometry = (scan.angle_min + mount_yaw, scan.angle_increment, len(scan.ranges), self._fov)
        beams, bins = binned(*geometry)
        ranges = np.where(has_return(scan), np.minimum(scan.ranges, self._range_max), self._no_return)[beams]
        if self._outlines is not None:
            ranges = ranges + _changes(self._outlines, *geometry)
        counts = np.bincount(bins, minlength=BINS)
        least, mean = np.full(BINS, math.inf), np.bincount(bins, ranges, BINS) / np.maximum(counts, 1)
        np.minimum.at(least, bins, ranges)
        pooled = np.where(counts > 0, np.stack((least, mean)), self._no_return)
        self._pooled.extendleft([pooled] * (1 if self._pooled else self._kept))

    def rows(self) -> Floats:
        """Rows (20, 80) in [−1, 1]: least and mean of each sweep, the oldest sweep first."""
        return 2.0 * np.vstack([self._pooled[age] for age in self._ages]) / self._range_max - 1.0


def velocity_maps(pedestrians: Floats) -> Floats:
    """Maps of the pedestrians' (P, 4) vx and vy, halved, in cells of 0.25 m: (2, 80, 80); 0 without one.

    Rows are x from 0 to 20 m ahead, columns y from 10 m to the left to 10 m to the right. Of two pedestrians in a
    cell the last one counts.
    """
    maps = np.zeros((2, SIDE, SIDE))
    x, y = pedestrians[:, 0], pedestrians[:, 1]
    inside = (x >= 0.0) & (x <= _AHEAD) & (np.abs(y) <= _ASIDE)
    rows = np.minimum(np.floor(x[inside] / _CELL), SIDE - 1).astype(np.int64)
    columns = np.minimum(np.floor((_ASIDE - y[inside]) / _CELL), SIDE - 1).astype(np.int64)
    maps[:, rows, columns] = pedestrians[inside, 2:].T / _FASTEST
    return maps


def free_ahead(scan: LaserScan, mount_yaw: float) -> float:
    """Least range within 45° of straight ahead [m]; inf without a return there."""
    beams, _ = binned(scan.angle_min + mount_yaw, scan.angle_increment, len(scan.ranges), 2 * _FRONT)
    ahead = scan._replace(ranges=scan.ranges[beams])
    return float(ahead.ranges[has_return(ahead)].min(initial=math.inf))


def image_of(sweeps: Floats, pedestrians: Floats) -> NDArray[np.float32]:
    """Image for the network (3, 80, 80): the rows of the sweeps (20, 80) four times, then the velocity maps."""
    image = np.empty((IMAGE, SIDE, SIDE), np.float32)
    image[0].reshape(_TILES, *sweeps.shape)[:] = sweeps
    image[1:] = velocity_maps(pedestrians)
    return image


def has_return(scan: LaserScan) -> Bools:
    """Return whether each beam has a return: (B,). NaN means none."""
    found: Bools = (scan.ranges >= scan.range_min) & (scan.ranges < scan.range_max)
    return found


@lru_cache(maxsize=16)
def _changes(
    outlines: Outlines, angle_min: float, angle_increment: float, num_beams: int, fov: float
) -> Floats:
    """Return `Outlines.change` of the beams within `fov`, centred straight ahead."""
    beams, _ = binned(angle_min, angle_increment, num_beams, fov)
    bearings = angle_min + angle_increment * beams
    return outlines.change(np.remainder(bearings + math.pi, math.tau) - math.pi)


@lru_cache(maxsize=16)
def binned(
    angle_min: float, angle_increment: float, num_beams: int, fov: float, bins: int = BINS
) -> tuple[Ints, Ints]:
    """Return the beams within `fov`, centred straight ahead, and their bins, from the right to the left."""
    angles = angle_min + angle_increment * np.arange(num_beams)
    angles = (angles + math.pi + _EDGE) % math.tau - math.pi  # a beam straight back is the first one
    beams = np.flatnonzero(np.abs(angles - _EDGE) <= fov / 2 + _EDGE)
    found = np.floor((angles[beams] + fov / 2) / (fov / bins)).astype(np.int64)
    return beams, np.clip(found, 0, bins - 1)
