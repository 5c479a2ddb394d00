"""The obstacle that blocks the path to the target, and a point for passing it (paper Algorithm 2).

An obstacle is a sector of scan points between which a robot cannot pass. Two points nearer than the gap span the arc
between them. The result depends only on which gaps between neighbours in bearing are spanned. First, near neighbours
are joined into runs, and runs are divided into blocks of a few points with a bounding box. Then, for each block, a
counter-clockwise search finds the farthest block with a point near enough to one of its points. The search skips gaps
that are spanned already and ends at the largest bearing at which a point can be near enough. It compares points only
if the boxes are near.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.types import Floats, Ints

RULES = ("corridor", "line_of_sight")


_BLOCK = 16  # [points] greatest size of a block


_SLACK = 1e-9  # widening of cones, more than any rounding error


class Blockage(NamedTuple):
    """The blocking sector and the point for passing it.

    points: (P, 2) the sector's scan points, counter-clockwise. E1, E2: (2,) its ends. A: the end nearer in
    angle to the target. B: (2,) the point r beyond A on the ray OA. All in the robot frame [m].
    """

    points: Floats
    E1: Floats
    E2: Floats
    A: Floats
    B: Floats


def find_blockage(
    points: Floats, target: Floats, radius: float, full_circle: bool, rule: str
) -> Blockage | None:
    """Find the sector between robot and target; None if there is none, or if the sectors form a closed ring.

    points: (M, 2) scan points sorted by bearing; target: (2,); radius: r [m].
    rule "corridor": the sector of the nearest scan point within r of the segment O–T;
    "line_of_sight": the sector that the ray towards T hits before T. A closed ring has no ends to pass.
    """
    blocking_point = nearest_near_segment if rule == "corridor" else _point_on_ray
    owner = int(blocking_point(points, target, radius))
    if owner < 0:
        return None
    sector, closed = _sector_of(points, owner, 2.0 * radius, full_circle)
    if closed:
        return None
    blocking = sector_points(points, sector)
    first_is_nearer, B = _past_the_end(blocking, target, radius)
    return Blockage(blocking, blocking[0], blocking[-1], blocking[0] if first_is_nearer else blocking[-1], B)


@njit(cache=True)
def _sector_of(points: Floats, index: int, gap: float, full_circle: bool) -> tuple[tuple[int, int], bool]:
    """Sector (first, last) that contains scan point `index`, and whether the sectors form a closed ring."""
    sectors, closed = cluster(points, gap, full_circle)
    first, last = 0, len(points) - 1
    for k in range(len(sectors)):
        first, last = sectors[k, 0], sectors[k, 1]
        if first <= index <= last or (first > last and (index >= first or index <= last)):
            break
    return (first, last), closed


@njit(cache=True)
def _past_the_end(sector: Floats, target: Floats, radius: float) -> tuple[bool, Floats]:
    """Return whether A is the first, not the last, of the sector's points (P, 2), and B, `radius` beyond A on OA."""
    first_is_nearer = _angle_between(sector[0], target) <= _angle_between(sector[-1], target)
    A = sector[0] if first_is_nearer else sector[-1]
    return first_is_nearer, A * (1.0 + radius / math.hypot(A[0], A[1]))


def sector_points(points: Floats, sector: Sequence[int] | Ints) -> Floats:
    """Scan points of one sector [first, last], counter-clockwise, also across ±π: (P, 2)."""
    first, last = sector
    if first <= last:
        return points[first : last + 1]
    return np.concatenate((points[first:], points[: last + 1]))


@njit(cache=True)
def nearest_near_segment(points: Floats, end: Floats, radius: float) -> int:
    """Index of the point nearest to the origin among those within `radius` of the segment origin–end.

    points (M, 2), end (2,) [m]; −1 if no point is nearer than `radius` to the segment.
    """
    best = -1
    best_square = np.inf
    length_square = end[0] * end[0] + end[1] * end[1]
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        square = x * x + y * y
        if square >= best_square:
            continue
        # Nearer than the radius to the start, the end or the inside of the segment, by where the point projects.
        along = x * end[0] + y * end[1]
        if along <= 0.0:
            is_near = square < radius * radius
        elif along >= length_square:
            is_near = (x - end[0]) ** 2 + (y - end[1]) ** 2 < radius * radius
        else:
            is_near = (end[0] * y - end[1] * x) ** 2 < radius * radius * length_square
        if is_near:
            best, best_square = i, square
    return best


def _point_on_ray(points: Floats, target: Floats, radius: float) -> int:
    """Index of the scan point nearest in angle to the target, if it is on the ray and before the target; else −1."""
    if len(points) == 0:
        return -1
    ahead = points @ target > 0.0
    across = np.abs(points[:, 0] * target[1] - points[:, 1] * target[0])
    distance = np.hypot(points[:, 0], points[:, 1])
    angle = np.where(ahead, across / np.maximum(distance, 1e-12), np.inf)
    index = int(np.argmin(angle))
    off_ray = angle[index] / max(math.hypot(target[0], target[1]), 1e-12)
    hit = off_ray * distance[index] < radius and distance[index] < math.hypot(target[0], target[1])
    return index if hit else -1


@njit(cache=True)
def _angle_between(a: Floats, b: Floats) -> float:
    """Unsigned angle ∠aOb [rad]."""
    return abs(math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]))


@njit(cache=True, error_model="numpy")
def cluster(points: Floats, gap: float, full_circle: bool) -> tuple[Ints, bool]:
    """Sectors of scan points that belong together, and whether they form a closed ring.

    points (M, 2) in the robot frame [m], sorted by bearing in (−π, π]. Two points nearer than `gap` [m] belong
    together, with all points on the shorter arc between them as seen from the origin. Unless full_circle, no
    points are joined across the blind arc from the last point to the first.
    Returns (K, 2) [first, last], counter-clockwise, sorted by `first`; first > last across ±π. The ring is closed
    if every gap is spanned, also the one from the last point to the first.
    """
    num_points = len(points)
    # Span gaps between neighbours, then between blocks; the gaps that stay open divide the sectors.
    spanned = np.zeros(num_points, np.bool_)  # the gap from each point to the next, cyclic
    _span_neighbours(points, gap * gap, full_circle, spanned)
    start, boxes, nearest = _blocks(points, spanned)
    _span_blocks(points, gap, full_circle, start, boxes, nearest, spanned)
    sectors = _sectors(spanned)
    # No gap is open: one closed ring.
    if num_points > 0 and len(sectors) == 0:
        ring = np.zeros((1, 2), np.int64)
        ring[0, 1] = num_points - 1
        return ring, True
    return sectors, False


@njit(cache=True, error_model="numpy")
def _ahead(xi, yi, xj, yj):
    """Return whether the counter-clockwise arc from i to j is the shorter one, for i before j by bearing."""
    return (yi < 0.0) == (yj < 0.0) or xi * yj - yi * xj >= 0.0


@njit(cache=True, error_model="numpy")
def _span_neighbours(points, gap_square, full_circle, spanned):
    """Mark the gaps between neighbours that are near each other on the shorter arc."""
    last_point = len(points) - 1
    for i in range(last_point):
        xi, yi, xj, yj = points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1]
        dx, dy = xj - xi, yj - yi
        spanned[i] = dx * dx + dy * dy < gap_square and _ahead(xi, yi, xj, yj)
    # The gap from the last point to the first is spanned across ±π.
    if full_circle and last_point > 0:
        xi, yi, xj, yj = points[0, 0], points[0, 1], points[last_point, 0], points[last_point, 1]
        dx, dy = xj - xi, yj - yi
        spanned[last_point] = dx * dx + dy * dy < gap_square and not _ahead(xi, yi, xj, yj)


@njit(cache=True, error_model="numpy")
def _blocks(points, spanned):
    """Divide runs into blocks: starts (K + 1,), boxes (K, 4), least squared distances from the origin (K,)."""
    start = np.empty(len(points) + 1, np.int64)
    boxes = np.empty((len(points), 4))  # x min, x max, y min, y max
    nearest = np.empty(len(points))
    k = -1
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        # Begin a block after an open gap, or if the last one is full.
        if i == 0 or not spanned[i - 1] or i - start[k] == _BLOCK:
            k += 1
            start[k] = i
            boxes[k, 0], boxes[k, 1], boxes[k, 2], boxes[k, 3] = x, x, y, y
            nearest[k] = x * x + y * y
            continue
        # Otherwise widen the current one.
        boxes[k, 0], boxes[k, 1] = min(boxes[k, 0], x), max(boxes[k, 1], x)
        boxes[k, 2], boxes[k, 3] = min(boxes[k, 2], y), max(boxes[k, 3], y)
        nearest[k] = min(nearest[k], x * x + y * y)
    start[k + 1] = len(points)
    return start[: k + 2], boxes[: k + 1], nearest[: k + 1]


@njit(cache=True, error_model="numpy")
def _span_blocks(points, gap, full_circle, start, boxes, nearest, spanned):
    """Mark the gaps between blocks that are joined directly or through other blocks.

    Block numbers continue into the next turn: b ≥ K is block b − K, reached across ±π.
    """
    num_blocks = len(nearest)
    chain_end = 0  # every gap from the current block up to this one is spanned
    for a in range(num_blocks):
        chain_end = max(chain_end, a)
        end = a + num_blocks if full_circle else num_blocks - 1
        # Skip the blocks that follow without an open gap.
        while chain_end < end and spanned[start[chain_end % num_blocks + 1] - 1]:
            chain_end += 1
        if chain_end == end:
            if full_circle:
                return
            continue
        # The farthest block that is linked to this one spans all gaps before it.
        farthest = _last_in_view(points, gap, start, nearest[a], a, chain_end, end)
        linked = _farthest_linked(points, gap * gap, start, boxes, a, chain_end, farthest)
        for b in range(chain_end, linked):
            spanned[start[b % num_blocks + 1] - 1] = True
        chain_end = linked


@njit(cache=True, error_model="numpy")
def _last_in_view(points, gap, start, nearest, a, chain_end, end):
    """Last block after `chain_end`, up to `end`, that may contain a point within the gap of a point in block a.

    The bearings of two points within the gap differ by at most asin(gap / d), where d is the distance of one of
    them from the origin, and always by less than π.
    """
    num_blocks = len(start) - 1
    i = start[a + 1] - 1
    xi, yi = points[i, 0], points[i, 1]
    # Greatest bearing: that of the block's last point, turned by asin(gap / d).
    sine = gap * (1.0 + _SLACK) / math.sqrt(nearest)
    bounded = sine < 1.0 - _SLACK
    cosine = math.sqrt(1.0 - sine * sine) if bounded else 0.0
    limit_x, limit_y = xi * cosine - yi * sine, yi * cosine + xi * sine
    # Stop at the first block that begins beyond it, or is no longer ahead.
    for b in range(chain_end + 1, end + 1):
        j = start[b - num_blocks] if b >= num_blocks else start[b]
        xj, yj = points[j, 0], points[j, 1]
        ahead = i != j and (_ahead(xi, yi, xj, yj) if b < num_blocks else not _ahead(xj, yj, xi, yi))
        if not ahead or (bounded and xj * limit_y - yj * limit_x < 0.0):
            return b - 1
    return end


@njit(cache=True, error_model="numpy")
def _farthest_linked(points, gap_square, start, boxes, a, chain_end, farthest):
    """Farthest block b, chain_end < b ≤ farthest, with a point linked to one in block a; else `chain_end`."""
    num_blocks = len(start) - 1
    left, right, bottom, top = boxes[a, 0], boxes[a, 1], boxes[a, 2], boxes[a, 3]
    for b in range(farthest, chain_end, -1):
        k = b - num_blocks if b >= num_blocks else b
        # The distance between the two boxes is a lower bound for that between their points.
        dx = max(boxes[k, 0] - right, left - boxes[k, 1], 0.0)
        dy = max(boxes[k, 2] - top, bottom - boxes[k, 3], 0.0)
        if dx * dx + dy * dy < gap_square and _linked(
            points, gap_square, start, boxes, a, k, b >= num_blocks
        ):
            return b
    return chain_end


@njit(cache=True, error_model="numpy")
def _linked(points, gap_square, start, boxes, a, b, is_wrapped):
    """Return whether a point of block b is near one of block a and ahead of it; is_wrapped: b is reached across ±π."""
    left, right, bottom, top = boxes[b, 0], boxes[b, 1], boxes[b, 2], boxes[b, 3]
    for i in range(start[a], start[a + 1]):
        xi, yi = points[i, 0], points[i, 1]
        # Skip points that are too far from the box of block b.
        dx, dy = max(left - xi, xi - right, 0.0), max(bottom - yi, yi - top, 0.0)
        if dx * dx + dy * dy >= gap_square:
            continue
        for j in range(start[b], min(start[b + 1], i) if is_wrapped else start[b + 1]):
            xj, yj = points[j, 0], points[j, 1]
            dx, dy = xj - xi, yj - yi
            if dx * dx + dy * dy >= gap_square:
                continue
            if (not _ahead(xj, yj, xi, yi)) if is_wrapped else _ahead(xi, yi, xj, yj):
                return True
    return False


@njit(cache=True, error_model="numpy")
def _sectors(spanned):
    """Sectors [first, last] between the gaps that are not spanned, sorted by `first`: (K, 2)."""
    num_points = len(spanned)
    across = num_points > 0 and spanned[num_points - 1]  # the first points belong to the last sector
    sectors = np.empty((num_points, 2), np.int64)
    count, first, last = 0, 0, -1
    # Every open gap ends a sector and begins the next.
    for i in range(num_points):
        if spanned[i]:
            continue
        if across and last < 0:
            last = i
        else:
            sectors[count, 0], sectors[count, 1] = first, i
            count += 1
        first = i + 1
    # The sector across ±π begins after the last open gap.
    if last >= 0:
        sectors[count, 0], sectors[count, 1] = first, last
        count += 1
    return sectors[:count]
