"""Ray casting against leaves of discs and of edges: each shape is tested against the beams in its angular extent only.

The extent is a cheap polynomial upper bound; the beams in it are tested exactly. Loops over the shapes of a leaf and
over beams have no branches, so they are vectorised. Near leaves come first, leaves and discs behind what the beams have
met so far are passed over, and the last leaf is the one before which all beams have ended.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64

from lme.geometry.edges import ray_to_edge
from lme.geometry.fan import BEARING_ERROR, bearing
from lme.grids.leaves import FAR, LEAF, near_first

_TWO_PI = 2.0 * math.pi
_ASIN_CUBIC = math.pi / 2.0 - 1.0  # asin(z) ≤ z + (π/2 − 1) z³ on [0, 1], with equality at both ends
_LANES = 4  # [beams] of a vector: more of them are tested at once than are in the extent
_FEW = 16  # [leaves] that are not worth a look at what the beams have met
_SLACK = 1e-6  # share, and [m], by which a leaf must lie behind; far above rounding errors


@njit(cache=True, error_model="numpy")
def scan_discs(frame, increment, range_max, table, bounds, shapes, first, stop, ranges):
    """Shorten ranges (B,) float32 to the discs of leaves first…stop − 1; return True if the lidar is inside one.

    frame: x and y of the lidar, cosine and sine of the heading of its first beam; table: `beam_table`.
    """
    leaves, gaps = near_first(frame[0], frame[1], range_max + _SLACK, bounds, first, stop)
    extents, nearest, beam = np.empty((7, LEAF)), _nearest_from_each(gaps), 0
    for k in range(len(leaves)):
        # Beams before this one have met something before this leaf and all later ones.
        beam = _first_beyond(beam, len(ranges), nearest[k], ranges)
        if beam == len(ranges):
            break
        if k >= _FEW and _is_hidden(leaves[k], gaps[k], frame, increment, bounds, ranges):
            continue
        if _meet_discs(frame, increment, range_max, table, shapes, leaves[k], extents, ranges):
            return True
    return False


@njit(cache=True, error_model="numpy")
def scan_edges(frame, increment, range_max, table, bounds, shapes, first, stop, ranges):
    """Shorten ranges (B,) float32 to the edges of leaves first…stop − 1. See `scan_discs`."""
    leaves, gaps = near_first(frame[0], frame[1], range_max + _SLACK, bounds, first, stop)
    extents, nearest, beam = np.empty((7, LEAF)), _nearest_from_each(gaps), 0
    for k in range(len(leaves)):
        # Beams before this one have met something before this leaf and all later ones.
        beam = _first_beyond(beam, len(ranges), nearest[k], ranges)
        if beam == len(ranges):
            break
        if k < _FEW or not _is_hidden(leaves[k], gaps[k], frame, increment, bounds, ranges):
            _meet_edges(frame, increment, range_max, table, shapes, leaves[k], extents, ranges)


@njit(cache=True, error_model="numpy")
def scan_shapes(frame, increment, range_max, table, circles, edges, ranges):
    """Shorten ranges (B,) float32 to all discs (C, 3) and edges (E, 4); inside a disc all are 0."""
    extents = np.empty((7, LEAF))
    leaf = np.empty((1, 4, LEAF))
    for first in range(0, len(circles), LEAF):
        _fill(leaf, circles, first, 3)
        if _meet_discs(frame, increment, range_max, table, leaf, 0, extents, ranges):
            ranges[:] = 0.0
            return
    for first in range(0, len(edges), LEAF):
        _fill(leaf, edges, first, 4)
        _meet_edges(frame, increment, range_max, table, leaf, 0, extents, ranges)


@njit(cache=True, error_model="numpy")
def _fill(leaf, shapes, first, width):
    """Copy shapes first…first + LEAF − 1 into a leaf; those missing are far away."""
    for i in range(LEAF):
        for j in range(width):
            missing = FAR if j < 2 or width == 4 else 0.0
            leaf[0, j, i] = shapes[first + i, j] if first + i < len(shapes) else missing


@njit(cache=True, error_model="numpy")
def _nearest_from_each(gaps):
    """Distance to the nearest of leaf k and all later ones, for each k [m]; leaves come only roughly in their order."""
    nearest = gaps.copy()
    for k in range(len(gaps) - 2, -1, -1):
        nearest[k] = min(nearest[k], nearest[k + 1])
    return nearest


@njit(cache=True, error_model="numpy")
def _first_beyond(first, stop, near, ranges):
    """First of beams first…stop − 1 that does not clearly end before `near` [m]; `stop` if there is none."""
    beam, limit = uint64(first), near * (1.0 - _SLACK) - _SLACK
    while beam < uint64(stop) and ranges[beam] < limit:
        beam += uint64(1)
    return beam


@njit(cache=True, error_model="numpy", inline="always")
def _are_nearer(near, first, stop, ranges):
    """Return whether beams first…stop − 1 have all met something before `near` [m]."""
    return _first_beyond(first, stop, near, ranges) == stop


@njit(cache=True, error_model="numpy")
def _is_hidden(leaf, gap, frame, increment, bounds, ranges):
    """Return whether a leaf lies behind the ranges met so far."""
    if gap <= 2.0 * _SLACK:
        return False
    low, high = _leaf_extent(frame, increment, bounds, leaf)
    turn = _TWO_PI / increment
    # The extent, and the same one turn earlier and later.
    for shift in (0.0, -turn, turn):
        first, stop = _beams(low + shift, high + shift, len(ranges))
        if not _are_nearer(gap, first, stop, ranges):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _leaf_extent(frame, increment, bounds, leaf):
    """Extent [low, high] in beams of a leaf's bounding disc, which does not contain the lidar."""
    x, y, cos, sin = frame
    dx, dy, radius = bounds[0, leaf] - x, bounds[1, leaf] - y, bounds[2, leaf]
    sine = radius / math.sqrt(dx * dx + dy * dy)
    half = sine + _ASIN_CUBIC * sine * sine * sine + BEARING_ERROR
    middle = bearing(cos * dx + sin * dy, cos * dy - sin * dx)
    return (middle - half) / increment, (middle + half) / increment


@njit(cache=True, error_model="numpy")
def _meet_discs(frame, increment, range_max, table, shapes, leaf, extents, ranges):
    """Shorten ranges to the discs of a leaf; return True if the lidar is inside one."""
    _disc_extents(frame, increment, shapes[leaf], extents)
    turn = _TWO_PI / increment
    for i in range(LEAF):
        u, v, low, high = extents[0, i], extents[1, i], extents[2, i], extents[3, i]
        square, near = extents[4, i], extents[6, i]
        if extents[5, i] <= square:
            return True
        # Skip discs that begin beyond range_max.
        reach = range_max + shapes[leaf, 2, i]
        if u * u + v * v >= reach * reach:
            continue
        # Beams within the extent, and within the same extent one turn earlier or later if there are any.
        _meet_disc(u, v, square, near, low, high, table, ranges)
        if high >= turn:
            _meet_disc(u, v, square, near, low - turn, high - turn, table, ranges)
        if low + turn < len(ranges):
            _meet_disc(u, v, square, near, low + turn, high + turn, table, ranges)
    return False


@njit(cache=True, error_model="numpy")
def _disc_extents(frame, increment, discs, extents):
    """Centres u, v in the lidar's frame, extents low, high in beams, squared radii and squared distances of discs."""
    x, y, cos, sin = frame
    per_radian = 1.0 / increment
    for i in range(LEAF):
        dx, dy, r = discs[0, i] - x, discs[1, i] - y, discs[2, i]
        u, v, square = cos * dx + sin * dy, cos * dy - sin * dx, dx * dx + dy * dy
        # Upper bound of the half angle asin(r / d).
        sine = r / math.sqrt(square)
        half = sine + _ASIN_CUBIC * sine * sine * sine + BEARING_ERROR
        middle = bearing(u, v)
        extents[0, i], extents[1, i] = u, v
        extents[2, i], extents[3, i] = (middle - half) * per_radian, (middle + half) * per_radian
        extents[4, i], extents[5, i], extents[6, i] = r * r, square, math.sqrt(square) - r


@njit(cache=True, error_model="numpy")
def _meet_disc(u, v, square, near, low, high, table, ranges):
    """Test beams low…high against a disc of squared radius `square` centred on (u, v)."""
    first, stop = _beams(low, high, len(ranges))
    if _are_nearer(near, first, stop, ranges):
        return
    for i in range(uint64(first), uint64(stop)):
        c, s = table[uint64(0), i], table[uint64(1), i]
        across = u * s - v * c
        along = u * c + v * s
        # Near intersection at along − √(r² − across²); NaN for a beam that passes by.
        distance = along - math.sqrt(square - across * across)
        ranges[i] = np.float32(distance) if (distance < ranges[i]) & (along > 0.0) else ranges[i]


@njit(cache=True, error_model="numpy")
def _meet_edges(frame, increment, range_max, table, shapes, leaf, extents, ranges):
    """Shorten ranges to the edges of a leaf."""
    _edge_extents(frame, increment, shapes[leaf], extents)
    turn = _TWO_PI / increment
    for i in range(LEAF):
        # Skip edges whose bounding box begins beyond range_max.
        if extents[6, i] >= range_max * range_max:
            continue
        start, end = (extents[0, i], extents[1, i]), (extents[2, i], extents[3, i])
        low, high = extents[4, i], extents[5, i]
        # Beams within the extent, and within the same extent one turn earlier or later if there are any.
        _meet_edge(start, end, low, high, table, ranges)
        if high >= turn:
            _meet_edge(start, end, low - turn, high - turn, table, ranges)
        if low + turn < len(ranges):
            _meet_edge(start, end, low + turn, high + turn, table, ranges)


@njit(cache=True, error_model="numpy")
def _edge_extents(frame, increment, edges, extents):
    """Ends of edges in the lidar's frame, extents low, high in beams, and squared gaps to their bounding boxes.

    An edge that the lidar is on, or almost, has the extent of a whole turn.
    """
    x, y, cos, sin = frame
    for i in range(LEAF):
        ax, ay, bx, by = edges[0, i] - x, edges[1, i] - y, edges[2, i] - x, edges[3, i] - y
        # The edge in the lidar's frame, with the first beam along +x.
        start_x, start_y = cos * ax + sin * ay, cos * ay - sin * ax
        end_x, end_y = cos * bx + sin * by, cos * by - sin * bx
        cross, dot = start_x * end_y - start_y * end_x, start_x * end_x + start_y * end_y
        # Counter-clockwise from low to high, across the bearing 0 if need be.
        to_start, to_end = bearing(start_x, start_y), bearing(end_x, end_y)
        low, high = (to_end, to_start) if cross < 0.0 else (to_start, to_end)
        high = high + _TWO_PI if high < low - 2.0 * BEARING_ERROR else high
        at_end = ((start_x == 0.0) & (start_y == 0.0)) | ((end_x == 0.0) & (end_y == 0.0))
        is_on = (abs(cross) <= -1e-6 * dot) | at_end
        gap_x = max(max(min(ax, bx), -max(ax, bx)), 0.0)
        gap_y = max(max(min(ay, by), -max(ay, by)), 0.0)
        extents[0, i], extents[1, i], extents[2, i], extents[3, i] = start_x, start_y, end_x, end_y
        extents[4, i] = 0.0 if is_on else (low - BEARING_ERROR) / increment
        extents[5, i] = _TWO_PI / increment if is_on else (high + BEARING_ERROR) / increment
        extents[6, i] = gap_x * gap_x + gap_y * gap_y


@njit(cache=True, error_model="numpy")
def _meet_edge(start, end, low, high, table, ranges):
    """Test beams low…high against the edge from start to end."""
    first, stop = _beams(low, high, len(ranges))
    for i in range(uint64(first), uint64(stop)):
        c, s = table[uint64(0), i], table[uint64(1), i]
        distance = ray_to_edge(start[0], start[1], end[0], end[1], c, s)
        ranges[i] = np.float32(distance) if distance < ranges[i] else ranges[i]


@njit(cache=True, error_model="numpy", inline="always")
def _beams(low, high, num_beams):
    """First and last + 1 of the beams low…high, and a few more to fill the last vector."""
    first, stop = max(math.ceil(low), 0), min(math.floor(high) + 1, num_beams)
    count = (stop - first + _LANES - 1) // _LANES * _LANES if stop > first else 0
    return first, min(first + count, max(num_beams, first))
