"""How far the nearest obstacle point is from each cell of a grid, drawn point by point and erased again."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats

_LANES = 8  # columns that are drawn at once; a fixed number, so that the compiler makes vectors of them
_ROUNDING = 1e-6  # [cells] that a window is wider


@njit(cache=True, error_model="numpy")
def pad(comfort: float, cell: float) -> int:
    """Cells around the grid that `draw` may write to."""
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
    """Lower `squares` to the distances from points that are less than `comfort` [m] away; changes the first four.

    squares: squared distance of each cell's centre to the nearest point [cells²], the grid's cells and `pad` more on
    all sides. Of several points in a cell all but the first may not count where they are `inner` [m] away (≤ comfort).
    first (size, size), all −1, becomes the index of one point in each cell, and following (≥ M,) that of the next one
    in the same cell; −1: none. points (M, 2), robot (2,) in the frame of the grid (x, y, cell, size). Returns the
    number of `marks` (≥ M,), which `erase` needs, and the robot's distance to the nearest point [m].
    """
    low_x, low_y, cell, size = grid
    span, half, border = _span(comfort, cell), _half(comfort, cell), pad(comfort, cell)
    near, nearest, count = _half(inner, cell), np.inf, 0
    for m in range(len(points)):
        x, y = (points[m, 0] - low_x) / cell, (points[m, 1] - low_y) / cell
        i, j = math.floor(x), math.floor(y)
        if not (-span <= i < size + span and -span <= j < size + span):
            continue
        nearest = min(nearest, (points[m, 0] - robot[0]) ** 2 + (points[m, 1] - robot[1]) ** 2)
        inside = 0 <= i < size and 0 <= j < size
        if inside and first[i, j] >= 0:
            reach = near
        else:
            reach = half
            marks[count] = (i - half + border) * squares.shape[1] + j - half + border
            count += 1
        if inside:
            following[m], first[i, j] = first[i, j], m
        for lane in range(0, half + reach + 1, _LANES):  # from where the first point's window begins
            left = j - half + lane
            middle = left + 0.5
            for a in range(i - reach, i + reach + 1):
                across = (a + 0.5 - x) ** 2
                row = squares[a + border, left + border : left + border + _LANES]
                for k in range(_LANES):
                    off = middle + k - y
                    row[k] = min(row[k], across + off * off)
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
    """Undo `draw`: `squares` is infinite again and `first` −1."""
    half, border, wide = _half(comfort, cell), pad(comfort, cell), squares.shape[1]
    size = len(first)
    for n in range(count):
        top, left = marks[n] // wide, marks[n] % wide
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
    """Points more than this number of cells outside the grid are left out."""
    return int(comfort / cell) + 1


@njit(cache=True, error_model="numpy", inline="always")
def _half(comfort, cell):
    """Cells on each side of a point's own that its window covers: those with a centre less than `comfort` away."""
    return int(comfort / cell + 0.5 + _ROUNDING)
