"""Navfn's potential on a cost grid, and the path down its gradient; ros-planning/navigation, navfn/src/navfn.cpp.

Potentials (I, J) are inf where a cell has none. `paid` (I, J): cost per cell; inf: not passable, as all border cells
must be. Cells are (i, j), and a point of a path lies at (i, j) in units of cells, cell centres at whole numbers.
"""

import math

import numpy as np
from numba import njit

from lme.geometry.heap import pop, push
from lme.types import Floats

Cell = tuple[int, int]

_STEP = 0.5  # [cells] between points of a path
_AROUND = 4.0  # free cells of cost by which the wave goes on beyond the goal, for the gradient there


@njit(cache=True, error_model="numpy")
def potential(paid: Floats, start: Cell, goal: Cell, neutral: float) -> Floats:
    """Cost of the way from `start` to each cell, as a wave that is plane between neighbours: (I, J).

    neutral: the least cost of a cell. The wave stops behind the goal. The start may be forbidden: the wave goes on to
    its four neighbours as far as these are passable.
    """
    rows, columns = paid.shape
    g = np.full(rows * columns, np.inf)
    flat = paid.ravel()
    keys, cells = np.empty(4 * rows * columns + 1), np.empty(4 * rows * columns + 1, np.int32)
    goal_index = goal[0] * columns + goal[1]
    g[start[0] * columns + start[1]], keys[0], cells[0], size = 0.0, 0.0, start[0] * columns + start[1], 1
    while size > 0:
        key, cell = keys[0], cells[0]
        size = pop(keys, cells, size)
        if key > g[cell]:
            continue  # outdated: the wave has come from another side since
        if key > g[goal_index] + _AROUND * neutral:
            break
        for neighbour in (cell - columns, cell + columns, cell - 1, cell + 1):
            # A neighbour up to this cell's value keeps its own: from here the wave arrives later.
            if g[neighbour] <= key or flat[neighbour] == np.inf:
                continue
            arrival = _arrival(g, neighbour, columns, flat[neighbour])
            if arrival < g[neighbour]:
                g[neighbour] = arrival
                size = push(keys, cells, size, arrival, neighbour)
    return g.reshape(rows, columns)


@njit(cache=True, error_model="numpy")
def _arrival(g: Floats, cell: int, columns: int, paid: float) -> float:
    """Potential of a cell by its lower neighbours along both axes: Navfn's approximation of a plane wave."""
    a = float(min(g[cell - columns], g[cell + columns]))
    b = float(min(g[cell - 1], g[cell + 1]))
    low, apart = min(a, b), abs(a - b)
    if not apart < paid:
        return low + paid
    share = apart / paid
    return low + paid * (-0.2301 * share * share + 0.5307 * share + 0.7040)


@njit(cache=True, error_model="numpy")
def descend(g: Floats, start: Cell, goal: Cell, neutral: float) -> Floats:
    """Path (K, 2) [cells] from the start to the goal cell, down the gradient from the goal; K = 0 if there is none.

    Where one of the nine cells has no potential, it goes to the lowest of them instead of along the gradient.
    """
    rows, columns = g.shape
    most = 4 * max(rows, columns) + rows * columns // 8
    path = np.empty((most, 2))
    i, j = goal
    di = dj = 0.0
    if g[i, j] == np.inf:
        return path[:0]
    for count in range(most):
        near_i, near_j = i + round(di), j + round(dj)
        if g[near_i, near_j] < neutral:
            path[count, 0], path[count, 1] = start
            return path[: count + 1][::-1].copy()
        path[count, 0], path[count, 1] = i + di, j + dj
        swings = count > 1 and path[count, 0] == path[count - 2, 0] and path[count, 1] == path[count - 2, 1]
        if swings or not np.isfinite(g[i - 1 : i + 2, j - 1 : j + 2]).all():
            low_i, low_j = i, j
            for a in range(i - 1, i + 2):
                for b in range(j - 1, j + 2):
                    if g[a, b] < g[low_i, low_j]:
                        low_i, low_j = a, b
            i, j, di, dj = low_i, low_j, 0.0, 0.0
            continue
        # Gradient by bilinear interpolation between this cell and the next ones.
        down_i = down_j = 0.0
        for a in range(2):
            for b in range(2):
                weight = (di if a else 1.0 - di) * (dj if b else 1.0 - dj)
                gradient = _gradient(g, i + a, j + b)
                down_i, down_j = down_i + weight * gradient[0], down_j + weight * gradient[1]
        length = math.hypot(down_i, down_j)
        if length == 0.0:
            return path[:0]
        di, dj = di + _STEP * down_i / length, dj + _STEP * down_j / length
        if abs(di) > 1.0:
            i, di = i + int(math.copysign(1.0, di)), di - math.copysign(1.0, di)
        if abs(dj) > 1.0:
            j, dj = j + int(math.copysign(1.0, dj)), dj - math.copysign(1.0, dj)
    return path[:0]


@njit(cache=True, error_model="numpy")
def _gradient(g: Floats, i: int, j: int) -> tuple[float, float]:
    """Direction in which the potential falls at a cell, of length 1 or 0; out of a cell without potential."""
    here = g[i, j]
    down_i, down_j = _slope(g[i - 1, j], here, g[i + 1, j]), _slope(g[i, j - 1], here, g[i, j + 1])
    length = math.hypot(down_i, down_j)
    return (down_i / length, down_j / length) if length > 0.0 else (0.0, 0.0)


@njit(cache=True, error_model="numpy", inline="always")
def _slope(before: float, here: float, after: float) -> float:
    """Twice the fall along one axis, of the sides that have a potential."""
    if here == np.inf:
        return -1.0 if before < np.inf else (1.0 if after < np.inf else 0.0)
    return (before - here if before < np.inf else 0.0) + (here - after if after < np.inf else 0.0)
