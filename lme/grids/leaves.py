"""Obstacles in leaves of sixteen neighbours, each with a bounding disc: a leaf that is out of reach costs one test.

They are the leaves of an R-tree that was packed by x and then by y (STR: Leutenegger, Lopez & Edgington 1997, DOI
10.1109/ICDE.1997.582015).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.types import Floats, Ints

LEAF = 16  # shapes in a leaf: loops of this length are vectorised
FAR = 1e200  # [m] where the rest of an incomplete leaf lies, beyond every reach
_SLACK = 1e-9  # share, and [m], by which bounding discs are widened; far above rounding errors


class Leaves(NamedTuple):
    """Discs, or edges, by leaf. bounds: (3, L) middle x, y and radius of the bounding discs [m].

    shapes: (L, 3, LEAF) discs x, y, r, or (L, 4, LEAF) edges x0, y0, x1, y1 [m]; those missing in a leaf are far away.
    """

    bounds: Floats
    shapes: Floats


def leaves_of(shapes: Floats) -> Leaves:
    """Sort discs (C, 3) or edges (E, 4) into leaves."""
    count, width = shapes.shape
    if count == 0:
        return Leaves(np.empty((3, 0)), np.empty((0, width, LEAF)))
    # About as many strips along y as there are leaves in a strip.
    num_leaves = math.ceil(count / LEAF)
    middles = shapes[:, :2] if width == 3 else (shapes[:, :2] + shapes[:, 2:]) / 2.0
    by_x = np.argsort(middles[:, 0], kind="stable")
    per_strip = LEAF * math.ceil(num_leaves / round(math.sqrt(num_leaves)))
    strips = np.split(by_x, range(per_strip, count, per_strip))
    order = np.concatenate([strip[np.argsort(middles[strip, 1], kind="stable")] for strip in strips])
    # Bound each leaf; the last one may repeat its last shape meanwhile.
    missing = num_leaves * LEAF - count
    order = np.concatenate([order, np.repeat(order[-1:], missing)])
    packed = np.ascontiguousarray(shapes[order].reshape(num_leaves, LEAF, width).transpose(0, 2, 1))
    bounds = _bounds(packed)
    packed[-1, :, LEAF - missing :] = FAR if width == 4 else np.array([[FAR], [FAR], [0.0]])
    return Leaves(bounds, packed)


def _bounds(packed: Floats) -> Floats:
    """Bounding discs (3, L) about the middles of the bounding boxes."""
    is_disc = packed.shape[1] == 3
    points = packed[:, :2] if is_disc else np.concatenate([packed[:, :2], packed[:, 2:]], axis=2)
    radii = packed[:, 2] if is_disc else np.zeros(1)
    low, high = (points - radii[:, None]).min(axis=2), (points + radii[:, None]).max(axis=2)
    middles = (low + high) / 2.0
    reaches = (np.hypot(*(points - middles[:, :, None]).transpose(1, 0, 2)) + radii).max(axis=1)
    scale = reaches + np.abs(middles).max(axis=1)
    return np.ascontiguousarray(np.column_stack([middles, reaches + _SLACK * (1.0 + scale)]).T)


NO_WALLS = leaves_of(np.empty((0, 4)))


def near_discs(leaves: Leaves, poses: Floats, box: tuple[float, float, float]) -> Floats:
    """Discs (K, 3) that may be the nearest, or in contact, at some pose.

    poses (P, 3) of a footprint, P ≥ 1; box (half_length, half_width, rounding) [m].
    """
    half_length, half_width, rounding = box
    r_min = min(half_length, half_width) + rounding
    r_max = math.hypot(half_length, half_width) + rounding
    discs: Floats = _near_discs(poses, float(r_min), float(r_max), *leaves)
    return discs


@njit(cache=True, error_model="numpy")
def middle_of(poses):
    """Position of the middle pose, and the greatest distance of a pose from it [m]."""
    x, y = poses[len(poses) // 2, 0], poses[len(poses) // 2, 1]
    travel = 0.0
    for k in range(len(poses)):
        travel = max(travel, math.hypot(poses[k, 0] - x, poses[k, 1] - y))
    return x, y, travel


@njit(cache=True, error_model="numpy")
def _near_discs(poses, r_min, r_max, bounds, shapes):
    """Discs for `near_discs`, by the bounds of the broad phase in `lme.geometry.collision`."""
    x, y, travel = middle_of(poses)
    gaps = gaps_to(x, y, bounds, 0, len(shapes))
    nearest = np.inf
    for k in range(len(shapes)):
        if gaps[k] < nearest:
            for i in range(LEAF):
                dx, dy = shapes[k, 0, i] - x, shapes[k, 1, i] - y
                nearest = min(nearest, math.sqrt(dx * dx + dy * dy) - shapes[k, 2, i])
    # The clearance at the middle pose is at most nearest − r_min, so farther discs cannot be the nearest.
    limit = (max(nearest - r_min, 0.0) + r_max + travel) * (1.0 + 1e-6)
    return shapes_within(x, y, limit, shapes, 0, gaps)


@njit(cache=True, error_model="numpy")
def gaps_to(x, y, bounds, first, stop):
    """Distances from (x, y) to the bounding discs of leaves first…stop − 1 [m], negative inside. It is vectorised."""
    gaps = np.empty(stop - first)
    for k in range(len(gaps)):
        dx, dy = bounds[0, first + k] - x, bounds[1, first + k] - y
        gaps[k] = math.sqrt(dx * dx + dy * dy) - bounds[2, first + k]
    return gaps


@njit(cache=True, error_model="numpy")
def shapes_within(x, y, limit, shapes, first, gaps):
    """Shapes (K, 3) or (K, 4), from the leaves with a gap up to the limit, whose own bounds come within it [m].

    gaps: of the leaves from number `first` on to (x, y). An edge's bound is the disc that has it as its diameter.
    """
    count = 0
    for k in range(len(gaps)):
        count += gaps[k] <= limit
    width = shapes.shape[1]
    near, count = np.empty((count * LEAF, width)), 0
    for k in range(len(gaps)):
        if gaps[k] > limit:
            continue
        leaf = shapes[first + k]
        for i in range(LEAF):
            if width == 3:
                dx, dy, reach = leaf[0, i] - x, leaf[1, i] - y, leaf[2, i]
            else:
                dx, dy = (leaf[0, i] + leaf[2, i]) / 2.0 - x, (leaf[1, i] + leaf[3, i]) / 2.0 - y
                reach = math.hypot(leaf[2, i] - leaf[0, i], leaf[3, i] - leaf[1, i]) / 2.0
            if math.sqrt(dx * dx + dy * dy) - reach <= limit:
                for j in range(width):
                    near[count, j] = leaf[j, i]
                count += 1
    return near[:count]


@njit(cache=True, error_model="numpy")
def near_first(x, y, reach, bounds, first, stop):
    """Leaves first…stop − 1 that begin within `reach` of (x, y), roughly the nearest first, and how far they are [m].

    Returns numbers (K,) and distances (K,) to their bounding discs, 0 inside.
    """
    gaps = gaps_to(x, y, bounds, first, stop)
    numbers = np.empty(len(gaps), np.int64)
    count = 0
    for k in range(len(gaps)):
        numbers[count] = k
        count += gaps[k] < reach
    numbers = numbers[:count]
    if count > LEAF:
        numbers = _by_distance(numbers, gaps, reach)
    distances = np.empty(count)
    for k in range(count):
        distances[k] = max(gaps[numbers[k]], 0.0)
        numbers[k] += first
    return numbers, distances


@njit(cache=True, error_model="numpy")
def _by_distance(numbers, gaps, reach):
    """Sort leaves into 64 classes of distance."""
    starts, scale = np.zeros(65, np.int64), 64.0 / reach
    for k in range(len(numbers)):
        starts[min(int(max(gaps[numbers[k]], 0.0) * scale), 63) + 1] += 1
    starts = np.cumsum(starts)
    ordered: Ints = np.empty_like(numbers)
    for k in range(len(numbers)):
        i = min(int(max(gaps[numbers[k]], 0.0) * scale), 63)
        ordered[starts[i]] = numbers[k]
        starts[i] += 1
    return ordered
