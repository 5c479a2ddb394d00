"""A grid over the edges of a large world, so that only those near a beam or a robot are tested.

A beam goes from cell to cell (Amanatides & Woo 1987, DOI 10.2312/egtp.19871000) and ends in the first in which it
meets an edge.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.collision import point_to_segment
from lme.geometry.edges import ray_to_edge
from lme.types import Floats, Ints

_SLACK = 1e-6  # [m] by which an edge may lie outside a cell that it belongs to; far above rounding errors
_SURE = 1e-9  # [m] an end farther from a beam's line is on its side for sure


class EdgeGrid(NamedTuple):
    """Edges by cell. frame: lowest x and y, side of a cell [m], rows, columns.

    Cell k = row · columns + column has edges[starts[k]:starts[k + 1]]; edges (K, 4) [x0, y0, x1, y1] [m].
    """

    frame: tuple[float, float, float, int, int]
    starts: Ints
    edges: Floats


NO_EDGES = EdgeGrid((0.0, 0.0, 1.0, 0, 0), np.zeros(1, np.int64), np.empty((0, 4)))


def edge_grid(edges: Floats) -> EdgeGrid:
    """Build the grid of edges (E, 4), E ≥ 1, with about E cells."""
    low, high = edges.reshape(-1, 2).min(axis=0) - _SLACK, edges.reshape(-1, 2).max(axis=0) + _SLACK
    side = math.sqrt((high - low).prod() / len(edges))
    columns, rows = (math.ceil(span / side) for span in (high - low).tolist())
    frame = (float(low[0]), float(low[1]), side, rows, columns)
    starts, cell_edges = _sort_by_cell(edges, *frame)
    return EdgeGrid(frame, starts, cell_edges)


def near_edges(grid: EdgeGrid, poses: Floats, box: tuple[float, float, float]) -> Floats:
    """Edges (K, 4) of the grid that may be the nearest of its edges, or in contact, at some pose.

    poses (P, 3) of a footprint, P ≥ 1; box (half_length, half_width, rounding) [m]. An edge may occur twice.
    """
    half_length, half_width, rounding = box
    r_min = min(half_length, half_width) + rounding
    r_max = math.hypot(half_length, half_width) + rounding
    candidates: Floats = _near_edges(poses, float(r_min), float(r_max), *grid)
    return candidates


@njit(cache=True, error_model="numpy")
def _sort_by_cell(edges, low_x, low_y, side, rows, columns):
    """Compute `starts` and `edges` of an `EdgeGrid`."""
    starts = np.zeros(rows * columns + 1, np.int64)
    # Count the edges of each cell; the sums are where the cells start.
    for i in range(len(edges)):
        for row in _rows(edges, i, low_y, side, rows):
            first_column, last_column = _columns(edges, i, row, low_x, low_y, side, columns)
            for column in range(first_column, last_column):
                starts[row * columns + column + 1] += 1
    starts = np.cumsum(starts)
    # Copy each edge to all cells that it touches.
    cell_edges, filled = np.empty((starts[-1], 4)), starts.copy()
    for i in range(len(edges)):
        for row in _rows(edges, i, low_y, side, rows):
            first_column, last_column = _columns(edges, i, row, low_x, low_y, side, columns)
            for k in range(row * columns + first_column, row * columns + last_column):
                cell_edges[filled[k]] = edges[i]
                filled[k] += 1
    return starts, cell_edges


@njit(cache=True, error_model="numpy")
def _rows(edges, i, low_y, side, rows):
    """Rows that edge i touches."""
    low, high = min(edges[i, 1], edges[i, 3]) - _SLACK, max(edges[i, 1], edges[i, 3]) + _SLACK
    return range(_cell(low, low_y, side, rows), _cell(high, low_y, side, rows) + 1)


@njit(cache=True, error_model="numpy")
def _columns(edges, i, row, low_x, low_y, side, columns):
    """First and last + 1 of the columns that edge i touches in a row."""
    x0, y0, along_x, along_y = edges[i, 0], edges[i, 1], edges[i, 2] - edges[i, 0], edges[i, 3] - edges[i, 1]
    begin, end = 0.0, 1.0  # of the part in the row
    # Clip the edge to the row, as shares of its length.
    if abs(along_y) > _SLACK:
        low, high = low_y + row * side - _SLACK - y0, low_y + (row + 1) * side + _SLACK - y0
        begin = max(min(low / along_y, high / along_y), 0.0)
        end = min(max(low / along_y, high / along_y), 1.0)
    from_x, to_x = x0 + begin * along_x, x0 + end * along_x
    first = _cell(min(from_x, to_x) - _SLACK, low_x, side, columns)
    return first, _cell(max(from_x, to_x) + _SLACK, low_x, side, columns) + 1


@njit(cache=True, error_model="numpy")
def _cell(coordinate, low, side, count):
    """Index of the row or column that contains a coordinate, or of the nearest one."""
    return min(max(math.floor((coordinate - low) / side), 0), count - 1)


@njit(cache=True, error_model="numpy")
def _near_edges(poses, r_min, r_max, frame, starts, edges):
    """Edges for `near_edges`, by the bounds of the broad phase in `lme.geometry.collision`."""
    x, y = poses[len(poses) // 2, 0], poses[len(poses) // 2, 1]
    travel = 0.0
    for k in range(len(poses)):
        travel = max(travel, math.hypot(poses[k, 0] - x, poses[k, 1] - y))
    # The clearance at the middle pose is at most gap − r_min, so farther edges cannot be the nearest.
    gap = nearest(x, y, frame, starts, edges)
    limit = (max(gap - r_min, 0.0) + r_max + travel) * (1.0 + 1e-6)
    return edges[_edges_within(x, y, limit, frame, starts, edges)]


@njit(cache=True, error_model="numpy")
def nearest(x, y, frame, starts, edges):
    """Distance from (x, y) to the nearest edge [m], found in a window that grows; inf if there is none."""
    if len(edges) == 0:
        return np.inf
    low_x, low_y, side, rows, columns = frame
    reach, farthest = 2.0 * side, math.hypot(abs(x - low_x), abs(y - low_y)) + side * (rows + columns)
    # Double the window until it holds an edge.
    indices = _edges_within(x, y, reach, frame, starts, edges)
    while len(indices) == 0 and reach < farthest:  # ends for any number, also inf and NaN
        reach *= 2.0
        indices = _edges_within(x, y, reach, frame, starts, edges)
    square = np.inf
    for i in indices:
        square = min(square, point_to_segment(x, y, edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]))
    return math.sqrt(square)


@njit(cache=True, error_model="numpy")
def _edges_within(x, y, limit, frame, starts, edges):
    """Indices of the edges within `limit` of (x, y)."""
    low_x, low_y, side, rows, columns = frame
    indices, count = np.empty(64, np.int64), 0
    first_column, last_column = _cell(x - limit, low_x, side, columns), _cell(x + limit, low_x, side, columns)
    # Exact distances of the edges in the cells of the window.
    for row in range(_cell(y - limit, low_y, side, rows), _cell(y + limit, low_y, side, rows) + 1):
        for i in range(starts[row * columns + first_column], starts[row * columns + last_column + 1]):
            square = point_to_segment(x, y, edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3])
            if square <= limit * limit:
                if count == len(indices):
                    indices = np.concatenate((indices, np.empty_like(indices)))
                indices[count] = i
                count += 1
    return indices[:count]


@njit(cache=True, error_model="numpy", inline="always")
def first_hit(x, y, turn, beam, far, frame, starts, edges):
    """Distance from (x, y) along a beam to the first edge of a grid if it is less than `far`, else `far` [m].

    beam: its direction (2,) in a frame whose heading in the world has cosine and sine `turn`. The arithmetic of a hit
    is that of `lme.perception.raycast`.
    """
    low_x, low_y, side, rows, columns = frame
    dx, dy = turn[0] * beam[0] - turn[1] * beam[1], turn[1] * beam[0] + turn[0] * beam[1]
    # Start cell, metres from border to border, and metres to the first border in each direction.
    cell_x, cell_y = (x - low_x) / side, (y - low_y) / side
    column, row = math.floor(cell_x), math.floor(cell_y)
    per_column, per_row = side / max(abs(dx), 1e-300), side / max(abs(dy), 1e-300)
    at_column = (column + 1 - cell_x if dx > 0.0 else cell_x - column) * per_column
    at_row = (row + 1 - cell_y if dy > 0.0 else cell_y - row) * per_row
    next_column, next_row = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
    is_inside = 0 <= column < columns and 0 <= row < rows
    # From outside the grid, all edges are tested at once.
    k = row * columns + column
    start, stop = (starts[k], starts[k + 1]) if is_inside else (0, len(edges))
    # Test the edges of one cell after another, until a hit lies in the cell itself.
    while True:
        far = _first_hit_among(x, y, turn, beam, dx, dy, far, edges, start, stop)
        if not is_inside or far < min(at_column, at_row) - _SURE:
            return far
        if at_column < at_row:
            column += next_column
            at_column += per_column
        else:
            row += next_row
            at_row += per_row
        if not (0 <= column < columns and 0 <= row < rows):
            return far
        k = row * columns + column
        start, stop = starts[k], starts[k + 1]


@njit(cache=True, error_model="numpy", inline="always")
def _first_hit_among(x, y, turn, beam, dx, dy, nearest, edges, start, stop):
    """Return the result of `first_hit` among edges start…stop − 1. dx, dy: the beam's direction in the world."""
    cos, sin = turn
    for i in range(start, stop):
        ax, ay, bx, by = edges[i, 0] - x, edges[i, 1] - y, edges[i, 2] - x, edges[i, 3] - y
        # Skip edges that are surely on one side of the beam's line.
        start_side, end_side = ax * dy - ay * dx, bx * dy - by * dx
        if (start_side > _SURE and end_side > _SURE) or (start_side < -_SURE and end_side < -_SURE):
            continue
        # The exact test, in the lidar's frame.
        start_x, start_y = cos * ax + sin * ay, cos * ay - sin * ax
        end_x, end_y = cos * bx + sin * by, cos * by - sin * bx
        nearest = min(nearest, ray_to_edge(start_x, start_y, end_x, end_y, beam[0], beam[1]))
    return nearest
