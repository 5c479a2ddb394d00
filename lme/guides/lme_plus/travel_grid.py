"""The grid of the search for expected times: its arrays, points drawn in it, and times between its cells."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Bools, Floats

HALF_DIAGONAL = math.sqrt(0.5)  # of a cell; no place in it is farther from its centre
GridNumbers = tuple[float, float, float, int]  # a Grid as a plain tuple
PaceNumbers = tuple[float, float, float, float, float, float, float]  # a SpeedProfile as a plain tuple
_STEP = 4  # cells between a place and those from which the slope of T there is taken
_LANES = 8  # columns that are drawn at once; a fixed number, so that the compiler makes vectors of them
_ROUNDING = 1e-6  # [cells] that a window is wider


class Grid(NamedTuple):
    """`size` × `size` square cells of side `cell` [m], of which those of the largest disc inside the frame are used.

    x, y: the corner with the lowest coordinates [m].
    """

    x: float
    y: float
    cell: float
    size: int


class SpeedProfile(NamedTuple):
    """The robot's expected speed at a place, by the distance d of the nearest obstacle point [m].

    d ≥ comfort: v_max [m/s]. From there down to d = inner the time per metre grows with the square of the difference,
    up to (1 + slowdown) times, and from there down to d = tight with the difference, up to `narrow` times. d < tight:
    no passage. Between points on two sides, d is half of the distance between these (`travel_time.half_width`). Within
    `room` [m] of a robot that is nearer to a point than `inner`, places that are as near as it, but for half a cell's
    diagonal, are passable, and in a passage between two sides as slow as d = inner: the robot is in it. If the target
    is nearer to a point than `inner`, ways of up to 2 inner lead to it where no point is in the cell itself. They take
    so long that the robot is expected to come as near as there is passage.
    """

    v_max: float
    tight: float
    inner: float
    comfort: float
    slowdown: float
    narrow: float
    room: float


class Workspace(NamedTuple):
    """Arrays that `travel_times` uses again, so that a call costs only what it visits. W = size + 2, C = W².

    times (W, W): the result [s]. tentative (C,): the least times so far [s]; −inf where no way leads, so outside the
    disc. edge (E,): the cells of the disc with a neighbour outside it. steps (C,): time across a cell [s], 0 if not
    known yet. narrow (C,): whether a cell is in a narrow passage, between points on two sides, if its step is known.
    away (C,): distance from the robot [cells], likewise. squares, first, marks: see `draw`. nodes
    (2, N): a cell that was put into a bucket, and the next node of that bucket. walls (C,): cells that were seen to be
    no passage. used (2,): number of nodes and of walls.
    """

    times: Floats
    tentative: Floats
    steps: Floats
    narrow: Bools
    away: Floats
    squares: Floats
    first: NDArray[np.int32]
    marks: NDArray[np.int32]
    nodes: NDArray[np.int32]
    walls: NDArray[np.int32]
    used: NDArray[np.int64]
    edge: NDArray[np.int32]


def workspace(size: int, cell: float, comfort: float) -> Workspace:
    """A workspace for grids of `size` × `size` cells of side `cell` [m], and one comfort [m]."""
    width, padded = size + 2, size + 2 * pad(comfort, cell)
    along = np.arange(width) - (size + 1) / 2
    disc = np.hypot(along[:, None], along) <= disc_radius(size)
    # Cells of the disc whose four neighbours are in it, too; the others are its edge.
    inner = np.zeros_like(disc)
    inner[1:-1, 1:-1] = disc[:-2, 1:-1] & disc[2:, 1:-1] & disc[1:-1, :-2] & disc[1:-1, 2:]
    return Workspace(
        times=np.full((width, width), np.inf),
        tentative=np.where(disc, np.inf, -np.inf).ravel(),
        steps=np.zeros(width * width),
        narrow=np.zeros(width * width, np.bool_),
        away=np.empty(width * width),
        squares=np.full((padded, padded), np.inf),
        first=np.full((size, size), -1, np.int32),
        marks=np.empty(padded * padded, np.int32),
        nodes=np.empty((2, 5 * width * width), np.int32),
        walls=np.empty(width * width, np.int32),
        used=np.zeros(2, np.int64),
        edge=np.flatnonzero(disc & ~inner).astype(np.int32),
    )


@njit(cache=True, error_model="numpy", inline="always")
def disc_radius(size: int) -> float:
    """Radius of the disc [cells]; one cell less than would fit, so that what is known reaches beyond its edge."""
    return 0.5 * size - 1.0


@njit(cache=True, error_model="numpy")
def cost_to_go_at(
    times: Floats,
    positions: Floats,
    pose: tuple[float, float, float],
    grid: Grid | GridNumbers,
    robot_time: float,
    slack: float,
    robot: Floats,
    target: Floats,
    v_max: float,
) -> Floats:
    """T at the (N, 2) positions in the frame at `pose` [s]: (N,), the least possible where nothing was searched.

    The search ended `slack` [s] after the time of the robot, which is at `robot` (2,). If that is inf, such positions
    have the time of the straight line to the target (2,), at v_max [m/s].
    """
    positions = _placed(positions, pose)
    costs = times_at(times, positions, grid)
    is_reached = robot_time < np.inf
    for n in range(len(positions)):
        if costs[n] == np.inf:
            # Not searched: the time at which the search ended, less the straight way from the robot; or, if the robot
            # has no way, the straight line to the target.
            reference = robot if is_reached else target
            dx, dy = positions[n, 0] - reference[0], positions[n, 1] - reference[1]
            straight = math.sqrt(dx * dx + dy * dy) / v_max
            costs[n] = max(robot_time + slack - straight, 0.0) if is_reached else straight
    return costs


@njit(cache=True, error_model="numpy")
def turns_at(
    times: Floats,
    positions: Floats,
    pose: tuple[float, float, float],
    grid: Grid | GridNumbers,
    target: Floats,
) -> Floats:
    """Angles between the straight ways from `pose` to (N, 2) positions in its frame and the steepest descents there.

    From 0 to π [rad]: (N,). The slope is that between the cells `_STEP` cells to each side of the place's own, or on
    one side only where the search did not reach the other. The angle is 0 at positions that the search did not reach,
    or reached alone, and nearer than `_STEP` cells to the target or the grid's edge.
    """
    low_x, low_y, cell, size = grid
    to_x, to_y, near_square = target[0], target[1], (_STEP * cell) ** 2
    placed, angles = _placed(positions, pose), np.zeros(len(positions))
    for n in range(len(positions)):
        x, y = placed[n, 0], placed[n, 1]
        i, j = math.floor((x - low_x) / cell) + 1, math.floor((y - low_y) / cell) + 1
        inside = _STEP < i <= size - _STEP and _STEP < j <= size - _STEP
        if not inside or times[i, j] == np.inf or (x - to_x) ** 2 + (y - to_y) ** 2 < near_square:
            continue
        # Steepest descent of T by differences, and its angle with the straight way.
        down_x = _fall(times[i - _STEP, j], times[i, j], times[i + _STEP, j])
        down_y = _fall(times[i, j - _STEP], times[i, j], times[i, j + _STEP])
        if down_x == 0.0 and down_y == 0.0:
            continue  # there is no descent, and the angle with a vector of −0 would be π
        x, y = x - pose[0], y - pose[1]
        angles[n] = abs(math.atan2(x * down_y - y * down_x, x * down_x + y * down_y))
    return angles


@njit(cache=True, error_model="numpy")
def _fall(lower, centre, upper):
    """Fall of T from one side of a cell to the other; twice that on one side if only this side has a time."""
    if lower < np.inf:
        return lower - upper if upper < np.inf else 2.0 * (lower - centre)
    return 2.0 * (centre - upper) if upper < np.inf else 0.0


@njit(cache=True, error_model="numpy")
def _placed(positions, pose):
    """Transform positions (N, 2) from the frame at `pose` to that of the grid."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    transformed = np.empty(positions.shape)
    for n in range(len(positions)):
        x, y = positions[n, 0], positions[n, 1]
        transformed[n, 0], transformed[n, 1] = pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y
    return transformed


@njit(cache=True, error_model="numpy")
def times_at(times: Floats, positions: Floats, grid: Grid | GridNumbers) -> Floats:
    """T at the (N, 2) positions by bilinear interpolation of the cells that have one [s]: (N,); inf if none has."""
    low_x, low_y, cell, size = grid
    interpolated = np.full(len(positions), np.inf)
    for n in range(len(positions)):
        # Place in cells, kept inside the grid: cell i is centred on i.
        x = min(max((positions[n, 0] - low_x) / cell + 0.5, 1.0), size - 1e-9)
        y = min(max((positions[n, 1] - low_y) / cell + 0.5, 1.0), size - 1e-9)
        i, j = int(x), int(y)
        # Weighted mean of those of the four cells around it that have a time.
        total, weights = 0.0, 0.0
        for a in range(2):
            for b in range(2):
                time = times[i + a, j + b]
                if time < np.inf:
                    weight = (x - i if a else i + 1 - x) * (y - j if b else j + 1 - y)
                    total += weight * time
                    weights += weight
        if weights > 0.0:
            interpolated[n] = total / weights
    return interpolated


@njit(cache=True, error_model="numpy")
def descend(
    times: Floats,
    narrow: Bools,
    pose: tuple[float, float, float],
    grid: Grid | GridNumbers,
    length: float,
    every: int,
) -> tuple[Floats, float]:
    """Places on the way of steepest descent of T, one per `every` cells, in the frame at the pose: (K, 2) [m].

    The way goes from cell to cell, beginning at the pose's, for at most `length` [m]. Also returns how far along it
    the first of the `narrow` cells (W²,) is [m], inf if there is none.
    """
    low_x, low_y, cell, size = grid
    i = min(max(int((pose[0] - low_x) / cell) + 1, 1), size)
    j = min(max(int((pose[1] - low_y) / cell) + 1, 1), size)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    max_steps = int(length / cell)
    path = np.empty((max_steps // every + 1, 2))
    count, travelled, ahead = 0, 0.0, 0.0 if narrow[i * (size + 2) + j] else np.inf
    for k in range(1, max_steps + 1):
        # Neighbour towards which T falls most steeply; at a minimum the way ends.
        steepest, di, dj = 0.0, 0, 0
        for a in range(-1, 2):
            for b in range(-1, 2):
                fall = (times[i, j] - times[i + a, j + b]) / math.sqrt(max(a * a + b * b, 1))
                if fall > steepest:
                    steepest, di, dj = fall, a, b
        if di == 0 and dj == 0:
            break
        i, j, travelled = i + di, j + dj, travelled + cell * math.sqrt(di * di + dj * dj)
        if ahead == np.inf and narrow[i * (size + 2) + j]:
            ahead = travelled
        if k % every == 0:
            # Centre of the cell in the frame at the pose.
            x, y = low_x + (i - 0.5) * cell - pose[0], low_y + (j - 0.5) * cell - pose[1]
            path[count, 0], path[count, 1] = cos * x + sin * y, cos * y - sin * x
            count += 1
    return path[:count], ahead


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
