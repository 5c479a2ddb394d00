"""Obstacle points of a planar scan in the robot frame, and those remembered in the lidar's blind arc."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.fan import diamond
from lme.geometry.frames import to_robot, to_world
from lme.grids.polar_histogram import active_cells
from lme.types import Bools, Floats, LaserScan, Observation, Pose


def obstacle_points(scan: LaserScan, mount: Pose) -> Floats:
    """Points hit by the beams, in the base frame, sorted by bearing about the base in (−π, π]: (M, 2) [m].

    mount: pose of the lidar in the base frame. A range that is not finite, below range_min or ≥ range_max is not
    a hit; M may be 0.
    """
    directions = beam_directions(scan.angle_min, scan.angle_increment, len(scan.ranges))
    # A plain tuple: Numba takes a named one for another type, and needs longer to recognise it.
    return scan_points(scan.ranges, directions, scan.range_min, scan.range_max, (*mount,))


def is_full_circle(scan: LaserScan) -> bool:
    """Return whether the first beam follows the last one after one increment, to within half an increment."""
    return (len(scan.ranges) + 0.5) * abs(scan.angle_increment) >= 2 * math.pi


@lru_cache(maxsize=16)
def beam_directions(angle_min: float, angle_increment: float, num_beams: int) -> Floats:
    """Unit vectors of the beams in the lidar frame: (num_beams, 2)."""
    angles = angle_min + angle_increment * np.arange(num_beams)
    return np.column_stack((np.cos(angles), np.sin(angles)))


@njit(cache=True, error_model="numpy")
def scan_points(
    ranges: NDArray[np.float32],
    directions: Floats,
    range_min: float,
    range_max: float,
    mount: tuple[float, float, float],
) -> Floats:
    """Points hit by the beams, in the base frame, sorted by bearing about the base in (−π, π]: (M, 2) [m].

    ranges (B,), directions (B, 2) in the lidar frame, mount: pose of the lidar in the base frame. A range that is
    not finite, below range_min or ≥ range_max is not a hit; both limits are rounded to float32, like the ranges.
    Points of equal bearing stay in the order of their beams.
    """
    # Sort by diamond angle, which rises with the bearing and needs no arctangent.
    points, keys = _hits(ranges, directions, np.float32(range_min), np.float32(range_max), mount)
    order = _order(keys)
    sorted_points = np.empty((len(order), 2))
    for i in range(len(order)):
        sorted_points[i, 0], sorted_points[i, 1] = points[order[i], 0], points[order[i], 1]
    return sorted_points


@njit(cache=True, error_model="numpy")
def _hits(ranges, directions, range_min, range_max, mount):
    """Points (M, 2) and their diamond angles (M,), in the order of the beams."""
    cos, sin = math.cos(mount[2]), math.sin(mount[2])
    points = np.empty((len(ranges), 2))
    keys = np.empty(len(ranges))
    count = 0
    for i in range(len(ranges)):
        if not (range_min <= ranges[i] < range_max):  # also drops NaN; range_max may be inf, a range may not
            continue
        # End of the beam in the lidar frame, then in the base frame.
        along, across = ranges[i] * directions[i, 0], ranges[i] * directions[i, 1]
        x = mount[0] + cos * along - sin * across
        y = mount[1] + sin * along + cos * across + 0.0  # −0 would turn a bearing of π into −π
        points[count, 0], points[count, 1] = x, y
        keys[count] = diamond(x, y)
        count += 1
    return points[:count], keys[:count]


@njit(cache=True, error_model="numpy")
def _order(keys):
    """Indices for a stable sort of the keys; fast if they rise except for one jump from π to −π."""
    n = len(keys)
    # Start after the jump, if there is one.
    start = 0
    for i in range(1, n):
        if keys[i] < keys[i - 1] - 2.0:
            start = i
    # Insertion sort: few points have to move, since the keys nearly rise.
    order = np.empty(n, np.int64)
    for k in range(n):
        new = start + k if start + k < n else start + k - n
        j = k
        while j > 0 and _after(keys, order[j - 1], new):
            order[j] = order[j - 1]
            j -= 1
        order[j] = new
    return order


@njit(cache=True, error_model="numpy")
def _after(keys, a, b):
    return keys[a] > keys[b] or (keys[a] == keys[b] and a > b)


class BlindArc:
    """Memory of obstacle points, in the odometry frame, while they are within `reach` [m] and in the blind arc.

    One point is kept for all those in a cell of side `cell` [m], at their mean. A lidar with a full circle has no
    blind arc.
    """

    def __init__(self, mount: Pose, reach: float, cell: float = 0.05) -> None:
        self._mount = mount
        self._reach, self._cell = reach, cell
        self._remembered = np.empty((0, 2))  # in the odometry frame

    def points(self, observation: Observation) -> Floats:
        """Points of the current scan and remembered points in the blind arc, in the robot frame: (M, 2) [m].

        The order is arbitrary. Call it at every step.
        """
        points = obstacle_points(observation.scan, self._mount)
        if is_full_circle(observation.scan):
            return points
        if len(self._remembered) > 0:
            remembered = to_robot(self._remembered, observation.odometry)
            points = np.concatenate((points, remembered[self._unseen(remembered, observation.scan)]))
        self._remembered = to_world(active_cells(points, self._cell, self._reach), observation.odometry)
        return points

    def _unseen(self, points: Floats, scan: LaserScan) -> Bools:
        """Return whether each point lies more than half an increment outside the field of view."""
        at_lidar = to_robot(points, self._mount)
        half_fov = 0.5 * len(scan.ranges) * abs(scan.angle_increment)
        middle = scan.angle_min + 0.5 * (len(scan.ranges) - 1) * scan.angle_increment
        bearings = np.arctan2(at_lidar[:, 1], at_lidar[:, 0]) - middle
        is_hidden: Bools = np.cos(bearings) < math.cos(half_fov)
        return is_hidden
