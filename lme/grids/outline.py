"""Cells under the outline of a footprint, and those inside it.

Lattice, `Grid` and `Costs` are those of `lme.grids.obstacle_grid`. An outline (P, 2) holds the corners of a convex
polygon in the robot frame [m]. Its sides are drawn from cell to cell: Bresenham 1965, DOI 10.1147/sj.41.0025.
"""

import math

import numpy as np
from numba import njit

from lme.grids.obstacle_grid import TOUCHING, Costs, Grid, Hits, lattice
from lme.types import Bools, Floats, Ints


@njit(cache=True, error_model="numpy")
def outline_capacity(outline: Floats, cell_size: float) -> int:
    """Greatest number of cells that `outline_cells` can list at any pose."""
    length = 0.0
    for k in range(len(outline)):
        m = (k + 1) % len(outline)
        length += math.hypot(outline[m, 0] - outline[k, 0], outline[m, 1] - outline[k, 1])
    return math.ceil(length / cell_size) + 3 * len(outline)


@njit(cache=True, error_model="numpy")
def outline_cells(
    outline: Floats, pose: tuple[float, float, float], grid: Grid, shape: tuple[int, int], cells: Ints
) -> int:
    """List the cells under the outline at `pose` in `cells` (M,), M ≥ `outline_capacity`, and return how many.

    Cells are indices of the flat array, corners are listed twice. Returns -1 if a corner is outside the array.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    count, last_corner = 0, len(outline) - 1
    i, j = _corner(outline, last_corner, pose, cos, sin, grid)
    # Draw the side from each corner to the next, beginning with the last corner.
    for k in range(len(outline)):
        a, b = _corner(outline, k, pose, cos, sin, grid)
        if a < 0 or b < 0 or a >= shape[0] or b >= shape[1]:
            return -1
        if k > 0 or (0 <= i < shape[0] and 0 <= j < shape[1]):  # the last corner is checked last
            count = _line(i, j, a, b, shape[1], cells, count)
        i, j = a, b
    return count


@njit(cache=True, error_model="numpy")
def outline_cost(
    costs: Costs, outline: Floats, pose: tuple[float, float, float], grid: Grid, cells: Ints
) -> int:
    """Highest cost under the outline at `pose`; -1 if it is `TOUCHING` or a corner is off the map.

    cells (M,), M ≥ `outline_capacity`, is overwritten.
    """
    flat = costs.ravel()
    highest = 0
    # Only the cells under the sides count, not those inside.
    count = outline_cells(outline, pose, grid, costs.shape, cells)
    for k in range(count):
        highest = max(highest, int(flat[cells[k]]))
    return -1 if count < 0 or highest >= TOUCHING else highest


@njit(cache=True, error_model="numpy")
def covered_cells(
    outline: Floats, pose: tuple[float, float, float], grid: Grid, shape: tuple[int, int]
) -> Bools:
    """Return whether each cell of the array lies under the outline at `pose` or inside it: (I, J).

    No cell does if a corner is outside the array.
    """
    cells = np.empty(outline_capacity(outline, grid[2]), np.int64)
    count = outline_cells(outline, pose, grid, shape, cells)
    covered = np.zeros(shape, np.bool_)
    # First and last column of the outline in each row; it is convex, so all between them are covered.
    low, high = np.full(shape[0], shape[1]), np.full(shape[0], -1)
    for k in range(count):
        i, j = cells[k] // shape[1], cells[k] % shape[1]
        low[i], high[i] = min(low[i], j), max(high[i], j)
    for i in range(shape[0]):
        covered[i, low[i] : high[i] + 1] = True
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
def _corner(outline, k, pose, cos, sin, grid):
    """Array index of the cell under corner k."""
    x = pose[0] + cos * outline[k, 0] - sin * outline[k, 1]
    y = pose[1] + sin * outline[k, 0] + cos * outline[k, 1]
    return lattice(x / grid[2]) - grid[0], lattice(y / grid[2]) - grid[1]


@njit(cache=True, error_model="numpy", inline="always")
def _line(i, j, a, b, columns, cells, count):
    """Append the cells from (i, j) to (a, b), both included, and return the new count."""
    di, dj = abs(a - i), abs(b - j)
    # Steps of the flat index along the longer axis and across it.
    along, across = (columns if a > i else -columns), (1 if b > j else -1)
    if dj > di:
        along, across = across, along
    major, minor = max(di, dj), min(di, dj)
    error, cell = major // 2, i * columns + j
    for _ in range(major + 1):
        cells[count] = cell
        count += 1
        # Step across whenever the error reaches a whole cell.
        error += minor
        if error >= major:
            error -= major
            cell += across
        cell += along
    return count
