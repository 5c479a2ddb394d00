"""Cells under the outline of a footprint, and those inside it.

Lattice, `Grid` and `Costs` are those of `lme.kernels.costmap`. An outline (P, 2) holds the corners of a convex polygon
in the robot frame [m]. Its sides are drawn from cell to cell: Bresenham 1965, DOI 10.1147/sj.41.0025.
"""

import math

import numpy as np
from numba import njit

from lme.kernels.costmap import TOUCHING, Costs, Grid, Hits, lattice
from lme.types import Bools, Floats, Ints


@njit(cache=True, error_model="numpy")
def outline_capacity(outline: Floats, cell_size: float) -> int:
    """The greatest number of cells that `outline_cells` can list at any pose."""
    length = 0.0
    for k in range(len(outline)):
        m = (k + 1) % len(outline)
        length += math.hypot(outline[m, 0] - outline[k, 0], outline[m, 1] - outline[k, 1])
    return math.ceil(length / cell_size) + 3 * len(outline)


@njit(cache=True, error_model="numpy")
def outline_cells(outline: Floats, pose: tuple[float, float, float], grid: Grid, cells: Ints) -> int:
    """List the array indices under the outline at `pose` in `cells` (M, 2), M ≥ `outline_capacity`; their number.

    Corners are listed twice. Cells may lie outside the array.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    count, last = 0, len(outline) - 1
    i = lattice((pose[0] + cos * outline[last, 0] - sin * outline[last, 1]) / grid[2]) - grid[0]
    j = lattice((pose[1] + sin * outline[last, 0] + cos * outline[last, 1]) / grid[2]) - grid[1]
    for k in range(len(outline)):
        a = lattice((pose[0] + cos * outline[k, 0] - sin * outline[k, 1]) / grid[2]) - grid[0]
        b = lattice((pose[1] + sin * outline[k, 0] + cos * outline[k, 1]) / grid[2]) - grid[1]
        count = _line(i, j, a, b, cells, count)
        i, j = a, b
    return count


@njit(cache=True, error_model="numpy")
def outline_cost(costs: Costs, cells: Ints, count: int) -> int:
    """The highest cost of the first `count` cells; -1 if one is `TOUCHING` or outside the array."""
    highest = 0
    for k in range(count):
        i, j = cells[k, 0], cells[k, 1]
        if i < 0 or j < 0 or i >= costs.shape[0] or j >= costs.shape[1] or costs[i, j] == TOUCHING:
            return -1
        if costs[i, j] > highest:
            highest = int(costs[i, j])
    return highest


@njit(cache=True, error_model="numpy")
def covered_cells(
    outline: Floats, pose: tuple[float, float, float], grid: Grid, shape: tuple[int, int]
) -> Bools:
    """Whether each cell of the array lies under the outline at `pose` or inside it: (I, J)."""
    cells = np.empty((outline_capacity(outline, grid[2]), 2), np.int64)
    count = outline_cells(outline, pose, grid, cells)
    covered = np.zeros(shape, np.bool_)
    low, high = np.full(shape[0], shape[1]), np.full(shape[0], -1)
    for k in range(count):
        i, j = cells[k, 0], cells[k, 1]
        if 0 <= i < shape[0]:
            low[i], high[i] = min(low[i], j), max(high[i], j)
    for i in range(shape[0]):
        covered[i, max(low[i], 0) : max(high[i] + 1, 0)] = True
    return covered


@njit(cache=True, error_model="numpy")
def free_covered(hits: Hits, outline: Floats, pose: tuple[float, float, float], grid: Grid) -> None:
    """Free the cells under and inside the outline at `pose`, in place: the robot is there, so nothing else is."""
    covered = covered_cells(outline, pose, grid, hits.shape)
    for i in range(hits.shape[0]):
        for j in range(hits.shape[1]):
            if covered[i, j]:
                hits[i, j] = 0


@njit(cache=True, error_model="numpy", inline="always")
def _line(i, j, a, b, cells, count):
    """Append the cells from (i, j) to (a, b), both included; the new count."""
    di, dj = abs(a - i), abs(b - j)
    step_i, step_j = (1 if a > i else -1), (1 if b > j else -1)
    most, least = max(di, dj), min(di, dj)
    error = most // 2
    for _ in range(most + 1):
        cells[count, 0], cells[count, 1] = i, j
        count += 1
        error += least
        across = error >= most
        if across:
            error -= most
        if di >= dj or across:
            i += step_i
        if dj > di or across:
            j += step_j
    return count
