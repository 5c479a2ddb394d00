"""The lattice under the edges of a map that was a picture, so that a beam crosses free space in a few steps.

Such edges lie on the lines between pixels. From every cell, in every quadrant of directions, a large rectangle is free
of edges; a beam goes from rectangle to rectangle.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats

FREE, BORDER, SEVERAL = -1, -2, -3  # on a side of a cell: no edge; the end of the lattice; more than one edge
SPAN_BITS = 7  # of a rectangle's columns, then its rows, in `Lattice.rectangles`; two bits are left for walls
SPAN_MAX = (1 << SPAN_BITS) - 1

_MOST_CELLS = 2**24  # 270 MB
_MISFIT = 1e-9  # [cells] by which an edge's end may miss its node


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
    """The lattice of edges (E, 4), E ≥ 1; `NO_LATTICE` if they do not lie on one, or if it has too many cells."""
    return _lattice_of(edges.tobytes())


@lru_cache(maxsize=2)
def _lattice_of(buffer: bytes) -> Lattice:
    """`lattice_of`, which worlds that differ only in what moves share."""
    edges = np.frombuffer(buffer).reshape(-1, 4).copy()
    spans = np.abs(edges[:, 2:] - edges[:, :2])
    lengths = spans.max(axis=1)
    if spans.min(axis=1).any() or not lengths.all():
        return NO_LATTICE
    low, high = edges.reshape(-1, 2).min(axis=0), edges.reshape(-1, 2).max(axis=0)
    counts = np.rint((high - low) / lengths.min())
    if not counts.all() or (counts + 2).prod() > _MOST_CELLS:
        return NO_LATTICE
    side = float(((high - low) / counts).max())  # more exact than the shortest edge
    places = (edges - np.tile(low, 2)) / side
    nodes = np.rint(places)
    if not np.abs(places - nodes).max() <= _MISFIT:
        return NO_LATTICE
    columns, rows = (int(count) + 2 for count in counts)  # with a free cell all around
    frame = (float(low[0]) - side, float(low[1]) - side, side, rows, columns)
    uprights, levels = _sides((nodes + 1).astype(np.int64), rows, columns)
    return Lattice(frame, uprights, levels, _rectangles(uprights, levels), edges)


@njit(cache=True, error_model="numpy")
def _sides(nodes, rows, columns):
    """`uprights` and `levels` of a `Lattice`, whose outermost cells are beyond its border."""
    uprights = np.full((rows, columns + 1), FREE, np.int32)
    levels = np.full((rows + 1, columns), FREE, np.int32)
    for i in range(len(nodes)):
        x0, y0, x1, y1 = nodes[i]
        for row in range(min(y0, y1), max(y0, y1)):
            uprights[row, x0] = i if uprights[row, x0] == FREE else SEVERAL
        for column in range(min(x0, x1), max(x0, x1)):
            levels[y0, column] = i if levels[y0, column] == FREE else SEVERAL
    for row in range(rows):
        for line in (0, 1, columns - 1, columns):
            uprights[row, line] = BORDER if uprights[row, line] == FREE else uprights[row, line]
    for column in range(columns):
        for line in (0, 1, rows - 1, rows):
            levels[line, column] = BORDER if levels[line, column] == FREE else levels[line, column]
    return uprights, levels


@njit(cache=True, error_model="numpy")
def _rectangles(uprights, levels):
    """`rectangles` of a `Lattice`."""
    rows, columns = len(uprights), levels.shape[1]
    out = np.empty((4, rows * columns), np.uint16)
    for quadrant in range(4):
        _grow(quadrant, uprights, levels, out[quadrant])
    return out


@njit(cache=True, error_model="numpy")
def _grow(quadrant, uprights, levels, out):
    """The rectangles of a quadrant, each that of a neighbour and one more row or column, or the cell alone.

    Rows and columns are counted in the direction of the quadrant, from the last to the first.
    """
    rows, columns = len(uprights), levels.shape[1]
    left, down = quadrant & 1, quadrant >> 1
    wide, high = np.zeros((2, 2, columns + 1), np.int64)  # in the last row and in this one
    open_rows = np.zeros(
        columns, np.int64
    )  # from the cell on, with no edge between them or to the next column
    for a in range(rows - 1, -1, -1):
        row = rows - 1 - a if down else a
        open_columns = 0
        wide[0], high[0] = wide[1], high[1]
        for b in range(columns - 1, -1, -1):
            column = columns - 1 - b if left else b
            wall, lid = uprights[row, column + 1 - left] != FREE, levels[row + 1 - down, column] != FREE
            open_rows[b] = 0 if wall else 1 if lid else 1 + open_rows[b]
            open_columns = 0 if lid else 1 if wall else 1 + open_columns
            w, h = 1, 1
            if not wall:
                w, h = min(wide[1, b + 1] + 1, SPAN_MAX), min(high[1, b + 1], open_rows[b])
            if not lid:
                other_w, other_h = min(wide[0, b], open_columns), min(high[0, b] + 1, SPAN_MAX)
                if _worth(other_w, other_h) > _worth(w, h):
                    w, h = other_w, other_h
            wide[1, b], high[1, b] = w, h
            entry = (uprights[row, column + left] != FREE) + 2 * (levels[row + down, column] != FREE)
            out[row * columns + column] = w | h << SPAN_BITS | entry << 2 * SPAN_BITS


@njit(cache=True, error_model="numpy", inline="always")
def _worth(wide, high):
    """How far beams of all directions go in a rectangle, about."""
    return wide * high / (wide + high)
