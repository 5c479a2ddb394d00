"""Conversion of lidar ranges to scan points."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.fan import diamond
from lme.types import Floats


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
