"""Polygons with few, long, axis-aligned sides around the occupied cells of a grid."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from lme.types import Bools, Floats, Ints

_EIGHT = np.ones((3, 3), dtype=bool)
_EAST, _NORTH, _WEST, _SOUTH = range(4)  # in this order a left turn adds 1


class _Run(NamedTuple):
    """A straight piece of outline with the occupied cells on its left."""

    direction: int
    end: tuple[int, int]


def outlines(occupied: Bools) -> list[Floats]:
    """Polygons (V, 2) [column, row] that together cover exactly the occupied cells.

    occupied: (rows, columns), row 0 at y = 0. Every polygon runs counter-clockwise and has no hole: a region
    with holes is cut into pieces. The cuts lie inside the region, where no beam can reach them.
    """
    return [_outline(piece) + np.array([column, row]) for piece, row, column in _pieces(occupied)]


def corners(occupied: Bools) -> int:
    """Count the corners of all outlines, without those at the cuts. It costs far less than the outlines."""
    # The outline has a corner where it contains just one of the edges to the left and to the right of a vertex.
    cells = np.pad(occupied, 1)
    left, right = cells[:, :-1], cells[:, 1:]
    edge_left, edge_right = left[1:] ^ left[:-1], right[1:] ^ right[:-1]
    touching = edge_left & edge_right & (left[1:] ^ right[1:])  # two cells, at a corner of each
    return int(np.count_nonzero(edge_left ^ edge_right) + 2 * np.count_nonzero(touching))


def _pieces(occupied: Bools) -> Iterator[tuple[Bools, int, int]]:
    """The 4-connected pieces without holes, each cropped, with its first row and column."""
    waiting = [(occupied, 0, 0)]
    while waiting:
        region, row, column = waiting.pop()
        labels, _ = ndimage.label(region)
        for number, (rows, columns) in enumerate(ndimage.find_objects(labels), start=1):
            piece = labels[rows, columns] == number
            first_row, first_column = row + rows.start, column + columns.start
            cut = None if piece.all() else _cut_row(piece)
            if cut is None:
                yield piece, first_row, first_column
            else:
                waiting.append((piece[:cut], first_row, first_column))
                waiting.append((piece[cut:], first_row + cut, first_column))


def _cut_row(piece: Bools) -> int | None:
    """The row through the middle one of the holes of a piece; None if there are no holes."""
    holes, count = ndimage.label(~np.pad(piece, 1), structure=_EIGHT)
    if count == 1:
        return None
    spans = [rows for rows, _ in ndimage.find_objects(holes)[1:]]  # the first touches the padding's corner
    middle = sorted(spans, key=lambda span: (span.start, span.stop))[len(spans) // 2]
    return int(middle.start + middle.stop - 1) // 2 - 1


def _outline(piece: Bools) -> Floats:
    """The outline (V, 2) of a 4-connected piece without holes."""
    if piece.all():  # as most pieces of a noisy map are
        rows, columns = piece.shape
        return np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], dtype=np.float64)
    # Follow the runs from any vertex until the first run comes again.
    starts = _runs(piece)
    first = next(iter(starts))
    run = starts[first][0]
    vertices = [first]
    while not (run.end == first and _next(starts, run) == starts[first][0]):
        vertices.append(run.end)
        run = _next(starts, run)
    return np.array(vertices, dtype=np.float64)


def _next(starts: dict[tuple[int, int], list[_Run]], run: _Run) -> _Run:
    """The run after `run`. There are two if two cells touch at a corner: the left turn stays with its cell."""
    followers = starts[run.end]
    if len(followers) == 1:
        return followers[0]
    return next(option for option in followers if option.direction == (run.direction + 1) % 4)


def _runs(piece: Bools) -> dict[tuple[int, int], list[_Run]]:
    """All runs of the outline, by the vertex (column, row) that they start from."""
    cells = np.pad(piece, 1).astype(np.int8)
    starts: dict[tuple[int, int], list[_Run]] = defaultdict(list)
    # Between rows: eastwards if the occupied cells are above the line, westwards if they are below it.
    for line, low, high, sign in _stretches(cells[1:, 1:-1] - cells[:-1, 1:-1]):
        begin, end = ((low, line), (high, line))[:: 1 if sign > 0 else -1]
        starts[begin].append(_Run(_EAST if sign > 0 else _WEST, end))
    # Between columns: northwards if the occupied cells are to the west of the line, southwards if to the east.
    for line, low, high, sign in _stretches((cells[1:-1, 1:] - cells[1:-1, :-1]).T):
        begin, end = ((line, low), (line, high))[:: 1 if sign < 0 else -1]
        starts[begin].append(_Run(_NORTH if sign < 0 else _SOUTH, end))
    return starts


def _stretches(steps: Ints) -> list[tuple[int, int, int, int]]:
    """(line, from, to, sign) of every maximal stretch of equal non-zero values along the rows of `steps`."""
    padded = np.pad(steps, ((0, 0), (1, 1)))
    changes = np.diff(padded, axis=1) != 0
    starts = np.argwhere(changes & (padded[:, 1:] != 0))
    ends = np.argwhere(changes & (padded[:, :-1] != 0))
    signs = steps[starts[:, 0], starts[:, 1]]
    stretches = np.column_stack([starts, ends[:, 1], signs])
    return [(line, low, high, sign) for line, low, high, sign in stretches.tolist()]
