"""Ray casting in a world whose edges lie on a lattice, with the results of `lme.perception.raycast` to the last bit.

Such edges come from a picture and lie on the lines between its pixels. From every cell, in every quadrant of
directions, a large rectangle is free of edges, so that a beam crosses free space from rectangle to rectangle.

All beams of a quadrant take a step before any takes the next, and a step has no branches, since a mispredicted one
would cost more than the step. The last step gives the edge that a beam hits. A beam that passes close to a node, or
almost along an axis, goes through the grid of edges instead, where it meets all edges that it may hit.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import int64, njit, uint64
from numpy.typing import NDArray

from lme.geometry.edges import ray_to_edge
from lme.grids.edge_grid import first_hit
from lme.types import Floats

FREE, BORDER, SEVERAL = -1, -2, -3  # on a side of a cell: no edge; the end of the lattice; more than one edge
SPAN_BITS = 7  # of a rectangle's columns, then its rows, in `Lattice.rectangles`; two bits are left for walls
SPAN_MAX = (1 << SPAN_BITS) - 1

_MOST_CELLS = 2**24  # 270 MB
_MISFIT = 1e-9  # [cells] by which an edge's end may miss its node
_NODE = 1e-5  # [cells] from a node, the cell that a beam enters is doubtful; far above rounding errors
_ALONG = 1e-3  # least sine of a beam's angle to both axes with which it is sure where it crosses a line
_SLACK = 1e-9  # [m] above rounding errors of distances
_UPRIGHT, _SURE, _WALL = (
    1,
    2,
    4,
)  # how a beam's last step ended: on a vertical side, at a sure place, at a wall


class Lattice(NamedTuple):
    """Edges on the lines of a lattice. frame: lowest x and y, side of a cell [m], rows, columns.

    uprights (rows, columns + 1), levels (rows + 1, columns): the edge on the left and on the lower side of a cell, as
    an index into edges (E, 4) [x0, y0, x1, y1] [m], or FREE, BORDER or SEVERAL. rectangles (4, rows · columns), one
    for each quadrant (1 for leftward + 2 for downward): columns and rows of a free rectangle that begins in the cell,
    and whether there is a wall on the vertical and on the horizontal side by which a beam enters the cell.
    """

    frame: tuple[float, float, float, int, int]
    uprights: NDArray[np.int32]
    levels: NDArray[np.int32]
    rectangles: NDArray[np.uint16]
    edges: Floats


NO_LATTICE = Lattice(
    (0.0, 0.0, 1.0, 0, 0),
    np.empty((0, 1), np.int32),
    np.empty((1, 0), np.int32),
    np.empty((4, 0), np.uint16),
    np.empty((0, 4)),
)


def lattice_of(edges: Floats) -> Lattice:
    """Build the lattice of edges (E, 4), E ≥ 1; `NO_LATTICE` if they lie on none, or if it has too many cells."""
    return _lattice_of(edges.tobytes())


@lru_cache(maxsize=2)
def _lattice_of(buffer: bytes) -> Lattice:
    """Build a lattice once for all worlds that differ only in their moving obstacles."""
    edges = np.frombuffer(buffer).reshape(-1, 4).copy()
    # All edges must be parallel to an axis and have a length.
    spans = np.abs(edges[:, 2:] - edges[:, :2])
    lengths = spans.max(axis=1)
    if spans.min(axis=1).any() or not lengths.all():
        return NO_LATTICE
    # A whole number of cells from border to border; the shortest edge says how many.
    low, high = edges.reshape(-1, 2).min(axis=0), edges.reshape(-1, 2).max(axis=0)
    counts = np.rint((high - low) / lengths.min())
    if not counts.all() or (counts + 2).prod() > _MOST_CELLS:
        return NO_LATTICE
    side = float(((high - low) / counts).max())  # more exact than the shortest edge
    node_coordinates = (edges - np.tile(low, 2)) / side
    nodes = np.rint(node_coordinates)
    if not np.abs(node_coordinates - nodes).max() <= _MISFIT:
        return NO_LATTICE
    columns, rows = (int(count) + 2 for count in counts)  # with a free cell all around
    frame = (float(low[0]) - side, float(low[1]) - side, side, rows, columns)
    uprights, levels = _sides((nodes + 1).astype(np.int64), rows, columns)
    return Lattice(frame, uprights, levels, _rectangles(uprights, levels), edges)


@njit(cache=True, error_model="numpy")
def _sides(nodes, rows, columns):
    """Compute `uprights` and `levels` of a `Lattice`; its outermost cells lie beyond its border."""
    uprights = np.full((rows, columns + 1), FREE, np.int32)
    levels = np.full((rows + 1, columns), FREE, np.int32)
    # Note the edge on every side that it covers; a second edge makes it SEVERAL.
    for i in range(len(nodes)):
        x0, y0, x1, y1 = nodes[i]
        for row in range(min(y0, y1), max(y0, y1)):
            uprights[row, x0] = i if uprights[row, x0] == FREE else SEVERAL
        for column in range(min(x0, x1), max(x0, x1)):
            levels[y0, column] = i if levels[y0, column] == FREE else SEVERAL
    # Free sides of the outermost cells end the lattice.
    for row in range(rows):
        for line in (0, 1, columns - 1, columns):
            uprights[row, line] = BORDER if uprights[row, line] == FREE else uprights[row, line]
    for column in range(columns):
        for line in (0, 1, rows - 1, rows):
            levels[line, column] = BORDER if levels[line, column] == FREE else levels[line, column]
    return uprights, levels


@njit(cache=True, error_model="numpy")
def _rectangles(uprights, levels):
    """Compute `rectangles` of a `Lattice`."""
    rows, columns = len(uprights), levels.shape[1]
    rectangles = np.empty((4, rows * columns), np.uint16)
    for quadrant in range(4):
        _grow(quadrant, uprights, levels, rectangles[quadrant])
    return rectangles


@njit(cache=True, error_model="numpy")
def _grow(quadrant, uprights, levels, rectangles):
    """Compute a quadrant's rectangles: each is a neighbour's and one more row or column, or the cell alone.

    Rows and columns are counted in the direction of the quadrant, from the last to the first.
    """
    rows, columns = len(uprights), levels.shape[1]
    left, down = quadrant & 1, quadrant >> 1
    widths, heights = np.zeros((2, 2, columns + 1), np.int64)  # in the last row and in this one
    open_rows = np.zeros(
        columns, np.int64
    )  # rows from the cell on, without an edge between them or to the next column
    for a in range(rows - 1, -1, -1):
        row = rows - 1 - a if down else a
        open_columns = 0
        widths[0], heights[0] = widths[1], heights[1]
        for b in range(columns - 1, -1, -1):
            column = columns - 1 - b if left else b
            # Edges towards the next column and the next row.
            wall, lid = uprights[row, column + 1 - left] != FREE, levels[row + 1 - down, column] != FREE
            open_rows[b] = 0 if wall else 1 if lid else 1 + open_rows[b]
            open_columns = 0 if lid else 1 if wall else 1 + open_columns
            # Extend the next column's rectangle by this cell's column, or the next row's by its row; keep the better.
            w, h = 1, 1
            if not wall:
                w, h = min(widths[1, b + 1] + 1, SPAN_MAX), min(heights[1, b + 1], open_rows[b])
            if not lid:
                other_w, other_h = min(widths[0, b], open_columns), min(heights[0, b] + 1, SPAN_MAX)
                if _worth(other_w, other_h) > _worth(w, h):
                    w, h = other_w, other_h
            widths[1, b], heights[1, b] = w, h
            # Edges on the two sides by which a beam enters the cell.
            entry = (uprights[row, column + left] != FREE) + 2 * (levels[row + down, column] != FREE)
            rectangles[row * columns + column] = w | h << SPAN_BITS | entry << 2 * SPAN_BITS


@njit(cache=True, error_model="numpy", inline="always")
def _worth(width, height):
    """Rough measure of how far beams of all directions go in a rectangle."""
    return width * height / (width + height)


@njit(cache=True, error_model="numpy")
def cast_lattice(
    x, y, heading, range_max, table, grid_frame, starts, in_cells, frame, uprights, levels, rectangles, edges
):
    """Return the result of `lme.perception.raycast.cast_grid` for an `EdgeGrid` and the `Lattice` of its edges.

    heading: of the first beam in the world [rad]; table: `beam_table`.
    """
    turn = (math.cos(heading), math.sin(heading))
    rates, quadrants = _rates(turn, table, 1.0 / frame[2])
    ranges = np.full(len(rates), np.float32(range_max), np.float32)
    doubtful, stop = np.ones(len(rates), np.bool_), 0
    if _is_sure(x, y, frame, uprights, levels):
        while stop < len(rates):
            # Neighbouring beams of one quadrant walk together.
            start = stop
            while stop < len(rates) and quadrants[stop] == quadrants[start]:
                stop += 1
            quadrant = int64(quadrants[start])
            steps, ends = _walk(x, y, range_max, frame, quadrant, rectangles[quadrant], rates[start:stop])
            beams = table[:, start:stop]
            sides = (quadrant & 1, quadrant >> 1, uprights, levels)
            _hit_edges(x, y, turn, beams, sides, edges, steps, ends, ranges[start:stop], doubtful[start:stop])
    # Doubtful beams go through the grid of edges.
    for i in range(len(rates)):
        if doubtful[i]:
            beam = (table[0, i], table[1, i])
            ranges[i] = first_hit(x, y, turn, beam, range_max, grid_frame, starts, in_cells)
    return ranges


@njit(cache=True, error_model="numpy")
def _rates(turn, table, cells_per_metre):
    """Columns and rows per metre, metres per column and per row of each beam: (B, 4); and its quadrant (B,)."""
    rates, quadrants = np.empty((table.shape[1], 4)), np.empty(table.shape[1], np.uint8)
    for i in range(table.shape[1]):
        dx = turn[0] * table[0, i] - turn[1] * table[1, i]
        dy = turn[1] * table[0, i] + turn[0] * table[1, i]
        columns, rows = abs(dx) * cells_per_metre, abs(dy) * cells_per_metre
        rates[i, 0], rates[i, 1], rates[i, 2], rates[i, 3] = columns, rows, 1.0 / columns, 1.0 / rows
        quadrants[i] = (dx < 0.0) + 2 * (dy < 0.0)
    return rates, quadrants


@njit(cache=True, error_model="numpy")
def _is_sure(x, y, frame, uprights, levels):
    """Return whether (x, y) is inside the lattice, and surely in one cell or where the choice does not matter."""
    low_x, low_y, side, rows, columns = frame
    cell_x, cell_y = (x - low_x) / side, (y - low_y) / side
    if not (1.0 < cell_x < columns - 1.0 and 1.0 < cell_y < rows - 1.0):
        return False
    column, row, line, level = int(cell_x), int(cell_y), round(cell_x), round(cell_y)
    # Close to a line between cells, the choice matters if an edge lies on it nearby.
    for k in range(-1, 2):
        if abs(cell_x - line) < _NODE and uprights[row + k, line] != FREE:
            return False
        if abs(cell_y - level) < _NODE and levels[level, column + k] != FREE:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _walk(x, y, range_max, frame, quadrant, free, rates):
    """Walk all beams of a quadrant to a wall or beyond range_max.

    Columns and rows are counted in the direction of the quadrant. Returns (B, 3) of the cell that a beam entered last:
    its column, its row, and its entry in `Lattice.rectangles`; and how the beam ended (B,).
    """
    low_x, low_y, side, rows, columns = frame
    x, y = (x - low_x) / side, (y - low_y) / side
    steps, ends = np.empty((len(rates), 3), np.int32), np.zeros(len(rates), np.uint8)
    # Mirror the start, so that columns and rows rise along the beams of every quadrant.
    origin, next_column, next_row = 0, 1, columns
    if quadrant & 1:
        x, origin, next_column = columns - x, columns - 1, -1
    if quadrant & 2:
        y, origin, next_row = rows - y, origin + (rows - 1) * columns, -columns
    column, row = int(x), int(y)
    entry = free[uint64(origin + row * next_row + column * next_column)]
    # Beams almost along an axis do not walk; they stay doubtful.
    walking, count = np.empty(len(rates), np.int32), 0
    for i in range(len(rates)):
        steps[i, 0], steps[i, 1], steps[i, 2] = column, row, entry
        walking[count] = i
        count += min(rates[i, 0], rates[i, 1]) * side >= _ALONG
    reach = range_max + _SLACK
    while count > 0:
        remaining = 0
        for j in range(count):
            i = uint64(walking[uint64(j)])
            column, row, entry = int64(steps[i, 0]), int64(steps[i, 1]), int64(steps[i, 2])
            # Far sides of the free rectangle, and the first of them that the beam meets.
            to_column, to_row = column + (entry & SPAN_MAX), row + (entry >> SPAN_BITS & SPAN_MAX)
            at_column, at_row = (to_column - x) * rates[i, 2], (to_row - y) * rates[i, 3]
            upright, distance = at_column < at_row, min(at_column, at_row)
            cell_x, cell_y = x + distance * rates[i, 0], y + distance * rates[i, 1]
            # Enter the cell behind that side; close to a node it is not sure which one this is.
            column, row = to_column if upright else int64(cell_x), int64(cell_y) if upright else to_row
            along = cell_y if upright else cell_x
            is_sure = abs(along - np.floor(along + 0.5)) > _NODE
            entry = int64(free[uint64(origin + row * next_row + column * next_column)])
            wall = entry >> (2 * SPAN_BITS if upright else 2 * SPAN_BITS + 1) & 1
            steps[i, 0], steps[i, 1], steps[i, 2] = column, row, entry
            ends[i] = upright * _UPRIGHT + is_sure * _SURE + wall * _WALL
            walking[uint64(remaining)] = i
            remaining += (wall == 0) & is_sure & (distance <= reach)
        count = remaining
    return steps, ends


@njit(cache=True, error_model="numpy")
def _hit_edges(x, y, turn, beams, sides, edges, steps, ends, ranges, doubtful):
    """Shorten the ranges of a quadrant's beams to the edges where they ended, and clear `doubtful` for sure ones.

    The arithmetic of a hit is that of `lme.perception.raycast`.
    """
    cos, sin = turn
    left, down, uprights, levels = sides
    rows, columns = len(uprights), levels.shape[1]
    for i in range(len(ranges)):
        # No sure wall: the beam went beyond range_max if its place is sure, and is doubtful otherwise.
        if ends[i] < _SURE + _WALL:
            doubtful[i] = ends[i] < _SURE or ends[i] >= _WALL
            continue
        column, row = int64(steps[i, 0]), int64(steps[i, 1])
        column, row = columns - 1 - column if left else column, rows - 1 - row if down else row
        # The edge on the side by which the beam entered its last cell.
        k = int64(
            uprights[uint64(row), uint64(column + left)]
            if ends[i] & _UPRIGHT
            else levels[uint64(row + down), uint64(column)]
        )
        if k < 0:
            doubtful[i] = k != BORDER
            continue
        k = uint64(k)
        ax, ay, bx, by = edges[k, 0] - x, edges[k, 1] - y, edges[k, 2] - x, edges[k, 3] - y
        # Distance along the beam to the edge's line, in the lidar's frame.
        start_x, start_y = cos * ax + sin * ay, cos * ay - sin * ax
        end_x, end_y = cos * bx + sin * by, cos * by - sin * bx
        distance = ray_to_edge(start_x, start_y, end_x, end_y, beams[0, i], beams[1, i])
        doubtful[i] = distance == np.inf
        ranges[i] = min(float(ranges[i]), distance)
