"""Expected time to a target from every cell of a local grid, around obstacle points.

The eikonal equation |∇T| = s is solved from the target outwards (fast marching: Sethian 1999, SIAM Review 41(2),
DOI 10.1137/S0036144598347059), with buckets instead of a heap (Yatziv, Bartesaghi & Sapiro 2006, J. Comput. Phys.
212(2), DOI 10.1016/j.jcp.2005.08.005). s is the time per metre. Cells are taken in the order of T plus the time that
the straight line from the robot takes, as in A*, so cells far off every way of the robot are never looked at.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.types import Bools, Floats, Ints

BUCKETS = 4096  # each as wide as the time for one cell at v_max; later times share the last one
_NEIGHBOURS = 4


class Grid(NamedTuple):
    """`size` × `size` square cells of side `cell` [m]. x, y: the corner with the lowest coordinates [m]."""

    x: float
    y: float
    cell: float
    size: int


class Pace(NamedTuple):
    """The robot's expected speed at a place, by the distance d of the nearest obstacle point [m].

    d ≥ comfort: v_max [m/s]. From there down to d = inner the time per metre grows with the square of the difference,
    up to (1 + slowdown) times. d < inner: no passage; but within `room` [m] of the robot, as at d = inner.
    """

    v_max: float
    inner: float
    comfort: float
    slowdown: float
    room: float


@njit(cache=True, error_model="numpy")
def travel_times(
    points: Floats, target: Floats, robot: Floats, grid: Grid, pace: Pace, beyond: float
) -> tuple[Floats, float]:
    """T of every cell [s] (W, W), and of the robot's cell [s]; W = size + 2, since a frame of inf is around the cells.

    points (M, 2); target (2,), robot (2,), in the frame of the grid [m]. A way that leaves the grid is straight and free
    from there to the target. Only ways from the robot that take at most `beyond` [s] more than the best are searched;
    cells on no such way are inf, as are those without passage.
    """
    wide = grid.size + 2
    slowness = _slowness(points, robot, grid, pace)
    cell_time = grid.cell / pace.v_max
    x, y = (target[0] - grid.x) / grid.cell + 0.5, (target[1] - grid.y) / grid.cell + 0.5
    rx, ry = (robot[0] - grid.x) / grid.cell + 0.5, (robot[1] - grid.y) / grid.cell + 0.5
    here = min(max(int(rx + 0.5), 1), grid.size) * wide + min(max(int(ry + 0.5), 1), grid.size)
    tentative, cells, count = _sources(slowness, x, y, grid.size, cell_time)
    keys = np.empty(count)
    for n in range(count):
        keys[n] = tentative[cells[n]] / cell_time + math.hypot(cells[n] // wide - rx, cells[n] % wide - ry)
    first = math.floor(keys.min()) if count else 0.0
    heads, follow = np.full(BUCKETS, -1, np.int32), np.empty(len(cells), np.int32)
    for n in range(count):
        bucket = min(int(keys[n] - first), BUCKETS - 1)
        follow[n], heads[bucket] = heads[bucket], n
    final = np.full(wide * wide, np.inf)
    bucket, stop = 0, BUCKETS
    while bucket < stop:
        node = heads[bucket]
        if node < 0:
            bucket += 1
            continue
        heads[bucket] = follow[node]
        at = cells[node]
        if final[at] < np.inf:
            continue
        final[at] = tentative[at]
        if at == here:
            stop = min(bucket + int(beyond / cell_time) + 1, BUCKETS)
        for k in range(_NEIGHBOURS):
            near = at + (1 if k == 0 else -1 if k == 1 else wide if k == 2 else -wide)
            step = slowness[near] * grid.cell
            if final[near] < np.inf or step == np.inf:
                continue
            time = _eikonal(
                min(final[near - wide], final[near + wide]), min(final[near - 1], final[near + 1]), step
            )
            if time < tentative[near] and count < len(cells):
                tentative[near] = time
                key = time / cell_time + math.sqrt((near // wide - rx) ** 2 + (near % wide - ry) ** 2)
                into = max(min(int(key - first), BUCKETS - 1), bucket)
                cells[count], follow[count], heads[into] = near, heads[into], count
                count += 1
    return final.reshape(wide, wide), final[here]


@njit(cache=True, error_model="numpy")
def _sources(slowness, x, y, size, cell_time):
    """Cells whose time is known: about the target, or the free ones at the edge. Tentative times, cells, their number."""
    wide = size + 2
    tentative = np.full(wide * wide, np.inf)
    cells = np.empty(5 * wide * wide, np.int32)
    count = 0
    inside = 1.0 <= x <= size and 1.0 <= y <= size
    for i in range(1, size + 1):
        at_side = i == 1 or i == size
        for j in range(1, size + 1, 1 if inside or at_side else size - 1):
            at = i * wide + j
            if (inside and max(abs(i - x), abs(j - y)) > 1.0) or (not inside and slowness[at] == np.inf):
                continue
            tentative[at] = math.hypot(i - x, j - y) * cell_time
            cells[count] = at
            count += 1
    return tentative, cells, count


@njit(cache=True, error_model="numpy", inline="always")
def _eikonal(a, b, step):
    """The time of a cell whose neighbours have times a along one axis and b along the other; inf: none."""
    apart = abs(a - b)
    if apart < step:
        return 0.5 * (a + b + math.sqrt(2.0 * step * step - apart * apart))
    return min(a, b) + step


@njit(cache=True, error_model="numpy")
def _slowness(points, robot, grid, pace):
    """Time per metre of every cell [s/m], flat, with the frame; inf where there is no passage."""
    wide = grid.size + 2
    squares = _squared_distances(points, grid, pace.comfort)
    out = np.full(wide * wide, np.inf)
    for a in range(grid.size):
        for b in range(grid.size):
            d = pace.comfort
            if squares[a, b] < np.inf:
                d = min(math.sqrt(squares[a, b]), pace.comfort)
            if d < pace.inner:
                dx, dy = grid.x + (a + 0.5) * grid.cell - robot[0], grid.y + (b + 0.5) * grid.cell - robot[1]
                if dx * dx + dy * dy > pace.room * pace.room:
                    continue
                d = pace.inner
            share = (pace.comfort - d) / (pace.comfort - pace.inner)
            out[(a + 1) * wide + b + 1] = (1.0 + pace.slowdown * share * share) / pace.v_max
    return out


@njit(cache=True, error_model="numpy")
def _squared_distances(points, grid, reach):
    """Squared distance of each cell's centre to the nearest point [m²]; inf beyond `reach`. One point per cell counts."""
    size, cell = grid.size, grid.cell
    squares = np.full((size, size), np.inf)
    taken = np.zeros((size, size), np.bool_)
    span = int(reach / cell) + 1
    for m in range(len(points)):
        x, y = (points[m, 0] - grid.x) / cell, (points[m, 1] - grid.y) / cell
        i, j = math.floor(x), math.floor(y)
        if not (-span <= i < size + span and -span <= j < size + span):
            continue
        if 0 <= i < size and 0 <= j < size:
            if taken[i, j]:
                continue
            taken[i, j] = True
        for a in range(max(i - span, 0), min(i + span + 1, size)):
            across = (a + 0.5 - x) ** 2
            for b in range(max(j - span, 0), min(j + span + 1, size)):
                square = (across + (b + 0.5 - y) ** 2) * cell * cell
                squares[a, b] = min(squares[a, b], square)
    return squares


@njit(cache=True, error_model="numpy")
def times_at(times: Floats, places: Floats, grid: Grid) -> Floats:
    """T at the (N, 2) places by bilinear interpolation of the cells that have one [s]: (N,); inf if none has."""
    out = np.full(len(places), np.inf)
    for n in range(len(places)):
        x = min(max((places[n, 0] - grid.x) / grid.cell + 0.5, 1.0), grid.size - 1e-9)
        y = min(max((places[n, 1] - grid.y) / grid.cell + 0.5, 1.0), grid.size - 1e-9)
        i, j = int(x), int(y)
        total, weights = 0.0, 0.0
        for a in range(2):
            for b in range(2):
                time = times[i + a, j + b]
                if time < np.inf:
                    weight = (x - i if a else i + 1 - x) * (y - j if b else j + 1 - y)
                    total += weight * time
                    weights += weight
        if weights > 0.0:
            out[n] = total / weights
    return out


@njit(cache=True, error_model="numpy")
def descend(times: Floats, start: Floats, grid: Grid, length: float, every: int) -> Floats:
    """Places on the way of steepest descent of T from (2,) `start`, one per `every` cells: (K, 2) [m].

    The way goes from cell to cell, for at most `length` [m].
    """
    i = min(max(int((start[0] - grid.x) / grid.cell) + 1, 1), grid.size)
    j = min(max(int((start[1] - grid.y) / grid.cell) + 1, 1), grid.size)
    most = int(length / grid.cell)
    places = np.empty((most // every + 1, 2))
    count = 0
    for k in range(1, most + 1):
        steepest, di, dj = 0.0, 0, 0
        for a in range(-1, 2):
            for b in range(-1, 2):
                fall = (times[i, j] - times[i + a, j + b]) / math.sqrt(max(a * a + b * b, 1))
                if fall > steepest:
                    steepest, di, dj = fall, a, b
        if di == 0 and dj == 0:
            break
        i, j = i + di, j + dj
        if k % every == 0:
            places[count, 0] = grid.x + (i - 0.5) * grid.cell
            places[count, 1] = grid.y + (j - 0.5) * grid.cell
            count += 1
    return places[:count]
