"""Distance from each cell of a grid to the nearest obstacle point, drawn point by point and erased again."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats

_LANES = 8  # columns that are drawn at once; a fixed number, so that the compiler makes vectors of them
_ROUNDING = 1e-6  # [cells] that a window is wider


@njit(cache=True, error_model="numpy")
def pad(comfort: float, cell: float) -> int:
    """Number of cells around the grid that `draw` may write to."""
    span: int = _span(comfort, cell)
    return 2 * span + _LANES


@njit(cache=True, error_model="numpy")
def draw(
    squares: Floats,
    first: NDArray[np.int32],
    following: NDArray[np.int32],
    marks: NDArray[np.int32],
    points: Floats,
    robot: Floats,
    grid: tuple[float, float, float, int],
    comfort: float,
    inner: float,
) -> tuple[int, float]:
    """Lower `squares` to the distances from points less than `comfort` [m] away. The first four arguments change.

    squares: squared distance of each cell's centre to the nearest point [cells²], the grid's cells and `pad` more on
    all sides. Of several points in a cell, all but the first may be ignored where they are `inner` [m] away (≤
    comfort). first (size, size), all −1, becomes the index of one point in each cell, and following (≥ M,) that of
    the next one in the same cell; −1: none. points (M, 2), robot (2,) in the frame of the grid (x, y, cell, size).
    Returns the number of `marks` (≥ M,), which `erase` needs, and the robot's distance to the nearest point [m].
    """
    low_x, low_y, cell, size = grid
    span, half, border = _span(comfort, cell), _half(comfort, cell), pad(comfort, cell)
    inner_half, nearest, count = _half(inner, cell), np.inf, 0
    for m in range(len(points)):
        x, y = (points[m, 0] - low_x) / cell, (points[m, 1] - low_y) / cell
        i, j = math.floor(x), math.floor(y)
        if not (-span <= i < size + span and -span <= j < size + span):
            continue
        nearest = min(nearest, (points[m, 0] - robot[0]) ** 2 + (points[m, 1] - robot[1]) ** 2)
        inside = 0 <= i < size and 0 <= j < size
        # The first point in a cell covers its whole window, and the others at least the inner part of it.
        if inside and first[i, j] >= 0:
            reach = inner_half
        else:
            reach = half
            marks[count] = (i - half + border) * squares.shape[1] + j - half + border
            count += 1
        # Put the point before the others in its cell.
        if inside:
            following[m], first[i, j] = first[i, j], m
        # Squared distances from the point to the centres of the window's cells, `_LANES` columns at once.
        for lane in range(0, half + reach + 1, _LANES):  # from where the first point's window begins
            left = j - half + lane
            middle = left + 0.5
            for a in range(i - reach, i + reach + 1):
                across = (a + 0.5 - x) ** 2
                row = squares[a + border, left + border : left + border + _LANES]
                for k in range(_LANES):
                    offset = middle + k - y
                    row[k] = min(row[k], across + offset * offset)
    return count, math.sqrt(nearest)


@njit(cache=True, error_model="numpy")
def erase(
    squares: Floats,
    first: NDArray[np.int32],
    marks: NDArray[np.int32],
    count: int,
    comfort: float,
    cell: float,
) -> None:
    """Undo `draw`: make `squares` infinite and `first` −1 again."""
    half, border, width = _half(comfort, cell), pad(comfort, cell), squares.shape[1]
    size = len(first)
    # The marked windows contain those of all other points.
    for n in range(count):
        top, left = marks[n] // width, marks[n] % width
        i, j = top + half - border, left + half - border
        if 0 <= i < size and 0 <= j < size:
            first[i, j] = -1
        for lane in range(0, 2 * half + 1, _LANES):
            for a in range(top, top + 2 * half + 1):
                row = squares[a, left + lane : left + lane + _LANES]
                for k in range(_LANES):
                    row[k] = np.inf


@njit(cache=True, error_model="numpy", inline="always")
def _span(comfort, cell):
    """Number of cells beyond which points outside the grid are left out."""
    return int(comfort / cell) + 1


@njit(cache=True, error_model="numpy", inline="always")
def _half(comfort, cell):
    """Cells on each side of a point's own that its window covers: those with a centre less than `comfort` away."""
    return int(comfort / cell + 0.5 + _ROUNDING)
