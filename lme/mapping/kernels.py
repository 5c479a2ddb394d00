"""Compiled loops over the cells of a map."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Bools, Floats, Ints


@njit(cache=True, error_model="numpy")
def trace_beams(hits, misses, ranges, angles, limits, clears_far, pose, resolution):
    """Count the cells that the beams of a scan pass and hit.

    hits, misses (rows, columns) int32: changed in place; they must hold every cell within limits[1] of the lidar.
    ranges (num_beams,) float32 [m]; angles (first, increment) [rad] in the frame of `pose`; limits (nearest valid
    range, farthest range that counts, range without a return) [m]; pose: x [cells], y [cells], yaw [rad].
    A beam that ends beyond limits[1] passes everything up to there; one without a return does so if `clears_far`.
    """
    x0, y0 = pose[0], pose[1]
    nearest, farthest, none = limits[0], limits[1], limits[2]
    for i in range(len(ranges)):
        length = float(ranges[i])
        if not (length > 0.0 and length >= nearest):  # also for nan
            continue
        if length >= none and not clears_far:
            continue
        is_hit = length <= farthest and length < none
        length = min(length, farthest) / resolution
        bearing = pose[2] + angles[0] + i * angles[1]
        x1, y1 = x0 + length * math.cos(bearing), y0 + length * math.sin(bearing)
        row, column = _pass(misses, x0, y0, x1, y1)
        if is_hit:
            hits[row, column] += 1
        else:
            misses[row, column] += 1


@njit(cache=True, error_model="numpy")
def _pass(misses, x0, y0, x1, y1):
    """Add 1 to every cell from (x0, y0) to just before the cell of (x1, y1); returns that cell's row and column.

    Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", 1987.
    """
    column, row = math.floor(x0), math.floor(y0)
    end_column, end_row = math.floor(x1), math.floor(y1)
    dx, dy = x1 - x0, y1 - y0
    right, up = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
    per_column = abs(1.0 / dx) if dx != 0.0 else np.inf
    per_row = abs(1.0 / dy) if dy != 0.0 else np.inf
    next_column = abs(column + (dx > 0.0) - x0) * per_column if dx != 0.0 else np.inf
    next_row = abs(row + (dy > 0.0) - y0) * per_row if dy != 0.0 else np.inf
    for _ in range(abs(end_column - column) + abs(end_row - row)):
        misses[row, column] += 1
        # Rounding must not carry the ray past the row or the column in which it ends.
        if row == end_row or (column != end_column and next_column < next_row):
            column += right
            next_column += per_column
        else:
            row += up
            next_row += per_row
    return end_row, end_column


@njit(cache=True, error_model="numpy")
def flooded(passable: Bools, seeds: Ints, steps: int) -> Bools:
    """(rows, columns) cells that at most `steps` steps between neighbours of a row or a column lead to.

    seeds (S, 2): rows and columns to start from; they count even if they are not passable.
    """
    rows, columns = passable.shape
    reached = np.zeros(passable.shape, np.bool_)
    queue = np.empty((passable.size, 2), np.int32)
    tail = 0
    for k in range(len(seeds)):
        row, column = seeds[k, 0], seeds[k, 1]
        if not reached[row, column]:
            reached[row, column] = True
            queue[tail, 0], queue[tail, 1] = row, column
            tail += 1
    head = 0
    for _ in range(steps):
        ring = tail
        while head < ring:
            row, column = queue[head, 0], queue[head, 1]
            head += 1
            for down, right in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                r, c = row + down, column + right
                if 0 <= r < rows and 0 <= c < columns and passable[r, c] and not reached[r, c]:
                    reached[r, c] = True
                    queue[tail, 0], queue[tail, 1] = r, c
                    tail += 1
    return reached


@njit(cache=True, error_model="numpy")
def densified(way: Floats, step: float, jump: float) -> Floats:
    """(P, 2) points at most `step` apart on the lines between the points of a way (N, 2), except across a `jump`."""
    count = 1
    for k in range(1, len(way)):
        count += _pieces(way, k, step, jump)
    points = np.empty((count, 2))
    points[0] = way[0]
    at = 1
    for k in range(1, len(way)):
        pieces = _pieces(way, k, step, jump)
        for i in range(1, pieces + 1):
            points[at] = way[k - 1] + (way[k] - way[k - 1]) * (i / pieces)
            at += 1
    return points


@njit(cache=True, error_model="numpy")
def _pieces(way, k, step, jump):
    length = math.hypot(way[k, 0] - way[k - 1, 0], way[k, 1] - way[k - 1, 1])
    return 1 if length > jump else max(math.ceil(length / step), 1)
