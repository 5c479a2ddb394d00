"""Expected time to a target from every cell of a local grid, around obstacle points.

The eikonal equation |∇T| = s is solved from the target outwards (fast marching: Sethian 1999, SIAM Review 41(2),
DOI 10.1137/S0036144598347059), with buckets instead of a heap (Yatziv, Bartesaghi & Sapiro 2006, J. Comput. Phys.
212(2), DOI 10.1016/j.jcp.2005.08.005). s is the time per metre. Cells are taken in the order of T plus the time that
the straight line from the robot takes, as in A*, so cells far from every possible way of the robot are never
visited. In this order a cell may come before one that it depends on; then its time is recomputed.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.types import Floats

BUCKETS = 4096  # each as wide as the time for one cell at v_max; later times share the last one
_NEIGHBOURS = 4
HALF_DIAGONAL = math.sqrt(0.5)  # of a cell; no place in it is farther from its centre
_GAIN = 0.1  # times for a cell by which a known time must improve to be recomputed


class Grid(NamedTuple):
    """`size` × `size` square cells of side `cell` [m]. x, y: the corner with the lowest coordinates [m]."""

    x: float
    y: float
    cell: float
    size: int


class Pace(NamedTuple):
    """The robot's expected speed at a place, by the distance d of the nearest obstacle point [m].

    d ≥ comfort: v_max [m/s]. From there down to d = inner the time per metre grows with the square of the difference,
    up to (1 + slowdown) times. d < inner: no passage. If the robot is nearer to a point than that, its own distance,
    less half a cell's diagonal, takes the place of `inner` within `room` [m] of it, and is as slow as `inner`.
    """

    v_max: float
    inner: float
    comfort: float
    slowdown: float
    room: float


@njit(cache=True, error_model="numpy")
def travel_times(
    points: Floats, target: Floats, robot: Floats, grid: Grid, pace: Pace, beyond: float, leave: bool
) -> tuple[Floats, float]:
    """T of every cell [s] (W, W), and of the robot's cell [s]; W = size + 2, since a frame of inf is around the cells.

    points (M, 2); target (2,), robot (2,), in the frame of the grid [m]. A way that leaves the grid is straight and
    free from there to the target; to a target on the grid, ways leave it only if `leave` is true. Only ways from the
    robot that take at most `beyond` [s] more than the best are searched; cells on no such way are inf, as are those
    without passage.
    """
    wide = grid.size + 2
    squares, least = _squared_distances(points, robot, grid, pace)
    cell_time = grid.cell / pace.v_max
    x, y = (target[0] - grid.x) / grid.cell + 0.5, (target[1] - grid.y) / grid.cell + 0.5
    rx, ry = (robot[0] - grid.x) / grid.cell + 0.5, (robot[1] - grid.y) / grid.cell + 0.5
    here = min(max(int(rx + 0.5), 1), grid.size) * wide + min(max(int(ry + 0.5), 1), grid.size)
    tentative = np.full(wide * wide, np.inf)
    inside = 1.0 <= x <= grid.size and 1.0 <= y <= grid.size
    cells, count = _sources(x, y, grid.size, inside, leave)
    follow, heads = np.empty(len(cells), np.int32), np.full(BUCKETS, -1, np.int32)
    first = math.floor(math.hypot(x - rx, y - ry)) - 2.0  # no key is less
    for n in range(count):
        i, j = cells[n] // wide, cells[n] % wide
        away = math.hypot(i - x, j - y)
        tentative[cells[n]] = away * cell_time
        bucket = min(int(away + math.hypot(i - rx, j - ry) - first), BUCKETS - 1)
        follow[n], heads[bucket] = heads[bucket], n
    final = np.full(wide * wide, np.inf)
    bucket, stop, least_gain = 0, BUCKETS, _GAIN * cell_time
    while bucket < stop:
        node = heads[bucket]
        if node < 0:
            bucket += 1
            continue
        heads[bucket] = follow[node]
        at = cells[node]
        if final[at] <= tentative[at]:
            continue
        final[at] = tentative[at]
        if at == here:
            stop = min(bucket + int(beyond / cell_time) + 1, BUCKETS)
        row, column = at // wide, at % wide
        for k in range(_NEIGHBOURS):
            i, j = row + (k == 2) - (k == 3), column + (k == 0) - (k == 1)
            near = i * wide + j
            if final[at] >= min(final[near], tentative[near] - least_gain):
                continue  # a time by way of this cell is longer than its own
            away = math.sqrt((i - rx) ** 2 + (j - ry) ** 2)
            step = grid.cell * _slowness(squares[near], away * grid.cell, least, pace)
            if step == np.inf:
                continue
            time = _eikonal(
                min(final[near - wide], final[near + wide]), min(final[near - 1], final[near + 1]), step
            )
            if time < tentative[near] - least_gain and count < len(cells):
                tentative[near] = time
                into = max(min(int(time / cell_time + away - first), BUCKETS - 1), bucket)
                cells[count], follow[count], heads[into] = near, heads[into], count
                count += 1
    return final.reshape(wide, wide), final[here]


@njit(cache=True, error_model="numpy")
def _sources(x, y, size, inside, leave):
    """Cells whose time is known, about the target or at the edge, in an array with room for more; their number."""
    wide = size + 2
    cells = np.empty(5 * wide * wide, np.int32)
    count = 0
    if inside:
        for i in range(max(int(x), 1), min(int(x) + 2, size + 1)):
            for j in range(max(int(y), 1), min(int(y) + 2, size + 1)):
                cells[count] = i * wide + j
                count += 1
    if not inside or leave:
        for k in range(1, size + 1):
            for at in (wide + k, size * wide + k, k * wide + 1, k * wide + size):
                cells[count] = at
                count += 1
    return cells, count


@njit(cache=True, error_model="numpy", inline="always")
def _eikonal(a, b, step):
    """The time of a cell whose neighbours have times a along one axis and b along the other; inf: none."""
    apart = abs(a - b)
    if apart < step:
        return 0.5 * (a + b + math.sqrt(2.0 * step * step - apart * apart))
    return min(a, b) + step


@njit(cache=True, error_model="numpy", inline="always")
def _slowness(square, away, least, pace):
    """Time per metre [s/m] by squared distance to the nearest point and distance to the robot; inf: no passage."""
    if square >= pace.comfort * pace.comfort:
        return 1.0 / pace.v_max
    if square < 0.0:
        return np.inf
    d = math.sqrt(square)
    if d < pace.inner:
        if d < least or away > pace.room:
            return np.inf
        d = pace.inner
    share = (pace.comfort - d) / (pace.comfort - pace.inner)
    return (1.0 + pace.slowdown * share * share) / pace.v_max


@njit(cache=True, error_model="numpy")
def _squared_distances(points, robot, grid, pace):
    """Squared distance of each cell's centre to the nearest point [m²], flat: inf beyond comfort, −1 in the frame.

    One point per cell counts. Also the distance that a passage near the robot must have [m].
    """
    size, cell, wide = grid.size, grid.cell, grid.size + 2
    squares = np.full(wide * wide, np.inf)
    for k in range(wide):
        squares[k] = squares[(wide - 1) * wide + k] = squares[k * wide] = squares[k * wide + wide - 1] = -1.0
    taken = np.zeros((size, size), np.bool_)
    span = int(pace.comfort / cell) + 1
    nearest, reach = np.inf, pace.comfort * pace.comfort
    for m in range(len(points)):
        x, y = (points[m, 0] - grid.x) / cell, (points[m, 1] - grid.y) / cell
        i, j = math.floor(x), math.floor(y)
        if not (-span <= i < size + span and -span <= j < size + span):
            continue
        nearest = min(nearest, (points[m, 0] - robot[0]) ** 2 + (points[m, 1] - robot[1]) ** 2)
        if 0 <= i < size and 0 <= j < size:
            if taken[i, j]:
                continue
            taken[i, j] = True
        for a in range(max(i - span, 0), min(i + span + 1, size)):
            across = (a + 0.5 - x) ** 2
            if across * cell * cell > reach:
                continue
            for b in range(max(j - span, 0), min(j + span + 1, size)):
                at = (a + 1) * wide + b + 1
                squares[at] = min(squares[at], (across + (b + 0.5 - y) ** 2) * cell * cell)
    return squares, min(math.sqrt(nearest), pace.inner) - HALF_DIAGONAL * cell


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
