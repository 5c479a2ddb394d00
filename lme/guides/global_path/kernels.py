"""Cheapest paths on a cost grid: Dijkstra and A*, path extraction and straightening.

A `table` (256,) maps `costs` (I, J) uint8 to the cost per cell of length; inf: not passable. A move to one of the
eight neighbours costs its length [cells] times the mean of the two cells; a diagonal move requires that both cells
next to it are passable. Ties are broken symmetrically in left and right.
"""

import math

import numpy as np
from numba import njit

from lme.geometry.heap import pop, push
from lme.grids.obstacle_grid import Costs
from lme.types import Floats, Ints

Cell = tuple[int, int]

_EPS = 1e-9  # relative difference of equal costs, by rounding
_TIE = 1e-8  # [cost/cell²] penalty for distance from the line: above rounding, below any cost difference
_SQRT2 = math.sqrt(2.0)


@njit(cache=True, error_model="numpy")
def search(costs: Costs, table: Floats, start: Cell, goal: Cell, heuristic_weight: float) -> Floats:
    """Cost of the cheapest path from start to each cell: (I, J); exact for the goal and the cells on its path.

    heuristic_weight 0: Dijkstra 1959, DOI 10.1007/BF01386390; 1: A* (Hart, Nilsson & Raphael 1968, DOI
    10.1109/TSSC.1968.300136) with the octile distance at the lowest cost of the table. Both find the same costs.
    The search stops at the goal; unreached cells are inf. start and goal must be on the grid.
    """
    rows, columns = costs.shape
    scale = heuristic_weight * table.min()
    # Best-first search: `keys` and `cells` are a heap of cells by `_key`.
    g = np.full(rows * columns, np.inf)
    keys, cells = np.empty(8 * rows * columns + 1), np.empty(8 * rows * columns + 1, np.int32)
    start_index, goal_index = start[0] * columns + start[1], goal[0] * columns + goal[1]
    g[start_index] = 0.0
    keys[0], cells[0], size = _octile(start[0] - goal[0], start[1] - goal[1]) * scale, start_index, 1
    while size > 0:
        key, cell = keys[0], cells[0]
        size = pop(keys, cells, size)
        i, j = cell // columns, cell % columns
        if key > _key(g[cell], scale, i, j, start, goal) * (1.0 + _EPS):
            continue  # outdated: a cheaper path was found later
        if cell == goal_index:
            break
        # A cheaper way over this cell lowers the cost of a neighbour, unless that is no higher than here.
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                neighbour = a * columns + b
                if a < 0 or b < 0 or a >= rows or b >= columns or g[neighbour] <= g[cell]:
                    continue
                step = _step(costs, table, i, j, di, dj)
                if step < np.inf and g[cell] + step < g[neighbour] * (1.0 - _EPS):
                    g[neighbour] = g[cell] + step
                    size = push(keys, cells, size, _key(g[neighbour], scale, a, b, start, goal), neighbour)
    return g.reshape(rows, columns)


@njit(cache=True, error_model="numpy")
def trace(g: Floats, costs: Costs, table: Floats, start: Cell, goal: Cell) -> Ints:
    """Cells of a cheapest path from start to goal: (K, 2); K = 0 if `search` did not reach the goal.

    Among equal paths, it takes the one nearer to the line from start to goal.
    """
    path = np.empty((g.size, 2), np.int64)
    if not np.isfinite(g[goal[0], goal[1]]):
        return path[:0]
    i, j = goal
    count = 0
    while True:
        path[count, 0], path[count, 1] = i, j
        count += 1
        if (i == start[0] and j == start[1]) or count == g.size:
            return path[:count][::-1].copy()
        # Go back to the neighbour with the least cost by way of it; in a tie, to the one nearer to the line.
        lowest, nearest, parent_i, parent_j = np.inf, np.inf, i, j
        for di in range(-1, 2):
            for dj in range(-1, 2):
                step = _step(costs, table, i, j, di, dj)
                cost = g[i + di, j + dj] + step if step < np.inf else np.inf
                if cost == np.inf:
                    continue
                offset = _off_line(i + di, j + dj, start, goal)
                if cost < lowest * (1.0 - _EPS) or (cost <= lowest * (1.0 + _EPS) and offset < nearest):
                    lowest, nearest, parent_i, parent_j = min(cost, lowest), offset, i + di, j + dj
        i, j = parent_i, parent_j


@njit(cache=True, error_model="numpy")
def straighten(path: Ints, g: Floats, costs: Costs, table: Floats) -> Ints:
    """Replace pieces of a path (K, 2) of cells by straight lines that cost no more, and return its corners (C, 2).

    g: costs from `search`. Paths with only eight directions are longer than necessary. The farthest possible line
    is tried first.
    """
    corners = np.empty_like(path)
    count, begin, goal_index = 0, 0, len(path) - 1
    while begin < goal_index:
        corners[count] = path[begin]
        count += 1
        # Try ever shorter lines, until one costs no more than the path between its ends.
        span = goal_index - begin
        while span > 1:
            end = begin + span
            allowed = (g[path[end, 0], path[end, 1]] - g[path[begin, 0], path[begin, 1]]) * (1.0 + _EPS)
            if _line_cost(costs, table, path[begin], path[end], allowed) <= allowed:
                break
            span = 3 * span // 4
        begin += span
    corners[count] = path[goal_index]
    return corners[: count + 1]


@njit(cache=True, error_model="numpy")
def departs(path: Floats, previous: Floats, limit: float) -> bool:
    """Return whether a point of `path` (K, 2) is farther than `limit` [m] from every point of `previous` (L, 2)."""
    nearest_index = 0  # start here, since the next point is probably near the same one
    for k in range(len(path)):
        # Look for a near point, beginning at the last one.
        is_near = False
        for n in range(len(previous)):
            m = (nearest_index + n) % len(previous)
            if (path[k, 0] - previous[m, 0]) ** 2 + (path[k, 1] - previous[m, 1]) ** 2 <= limit * limit:
                is_near, nearest_index = True, m
                break
        if not is_near:
            return True
    return False


@njit(cache=True, error_model="numpy")
def nearest_passable(costs: Costs, table: Floats, cell: Cell, towards: Cell) -> Cell:
    """Passable cell nearest to `cell`, in a tie the one nearer to `towards`; (-1, -1) if there is none."""
    rows, columns = costs.shape
    best, best_towards, best_i, best_j = np.inf, np.inf, -1, -1
    # Square rings around the cell, until all cells of the next are farther away than the best.
    for ring in range(max(rows, columns)):
        if ring * ring > best:
            break
        for i in range(max(cell[0] - ring, 0), min(cell[0] + ring + 1, rows)):
            # All cells on the first and last row of a ring, the two ends of the others.
            across = 1 if abs(i - cell[0]) == ring else max(2 * ring, 1)
            for j in range(cell[1] - ring, cell[1] + ring + 1, across):
                if 0 <= j < columns and table[costs[i, j]] < np.inf:
                    square = (i - cell[0]) ** 2 + (j - cell[1]) ** 2
                    towards_square = (i - towards[0]) ** 2 + (j - towards[1]) ** 2
                    if square < best or (square == best and towards_square < best_towards):
                        best, best_towards, best_i, best_j = square, towards_square, i, j
    return best_i, best_j


@njit(cache=True, error_model="numpy")
def _line_cost(costs, table, a, b, max_cost):
    """Cost of the straight line between two cells, sampled twice per cell; stops once it exceeds `max_cost`."""
    di, dj = b[0] - a[0], b[1] - a[1]
    length = math.hypot(di, dj)
    pieces = math.ceil(2.0 * length)
    total, previous_cost = 0.0, table[costs[a[0], a[1]]]
    # Trapezoidal rule: each piece costs its length times the mean of its ends.
    for k in range(1, pieces + 1):
        i = int(math.copysign(math.floor(abs(di) * k / pieces + 0.5), di))
        j = int(math.copysign(math.floor(abs(dj) * k / pieces + 0.5), dj))
        cell_cost = table[costs[a[0] + i, a[1] + j]]
        total += 0.5 * (previous_cost + cell_cost) * length / pieces
        previous_cost = cell_cost
        if total > max_cost:
            break
    return total


@njit(cache=True, error_model="numpy", inline="always")
def _step(costs, table, i, j, di, dj):
    """Cost of a move; inf if it is not possible."""
    a, b = i + di, j + dj
    if a < 0 or b < 0 or a >= costs.shape[0] or b >= costs.shape[1] or (di == 0 and dj == 0):
        return np.inf
    mean = 0.5 * (table[costs[i, j]] + table[costs[a, b]])
    if di == 0 or dj == 0:
        return mean
    # A diagonal move must not cut a corner that is not passable.
    if table[costs[i, b]] == np.inf or table[costs[a, j]] == np.inf:
        return np.inf
    return _SQRT2 * mean


@njit(cache=True, error_model="numpy", inline="always")
def _key(g, scale, i, j, start, goal):
    """Priority of a cell: cost so far plus heuristic; ties go to the cell nearer to the line from start to goal.

    Without the tie-break, rounding would decide which cells the search visits, and so the path.
    """
    return g + scale * _octile(i - goal[0], j - goal[1]) + _TIE * _off_line(i, j, start, goal)


@njit(cache=True, error_model="numpy", inline="always")
def _off_line(i, j, start, goal):
    """Distance of a cell from the line from start to goal, times the line's length [cells²]."""
    return abs((i - start[0]) * (goal[1] - start[1]) - (j - start[1]) * (goal[0] - start[0]))


@njit(cache=True, error_model="numpy")
def _octile(di, dj):
    """Octile distance: length of the shortest path with eight neighbours [cells]."""
    a, b = abs(di), abs(dj)
    return max(a, b) + (_SQRT2 - 1.0) * min(a, b)
