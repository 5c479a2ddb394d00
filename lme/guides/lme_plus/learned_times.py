"""Travel times learned while driving: lower bounds from earlier searches, and the places where the robot was stuck."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.guides.lme.criteria import distances_to
from lme.guides.lme_plus.travel_grid import Grid, GridNumbers, disc_radius
from lme.types import Floats

OTHER_TARGET = 1.0  # [m] by which the target may move before what was learned of the ways to it is forgotten
Learned = tuple[
    Floats, tuple[int, int]
]  # times (A, B) [s]; row and column in them before a grid's first cell
_MIN_WAIT = 2.0  # [s] total time stuck before a place, from which on the place counts
_COST = 10.0  # [-] delay of the way through a place, in multiples of the time stuck before it
_PLACE_DISTANCE = 0.5  # [m] nearer places count as one
_RADIUS = 0.3  # [m] around a place within which the way takes longer


@njit(cache=True, error_model="numpy")
def learn(
    learned: Floats,
    corner: tuple[int, int],
    times: Floats,
    grid: GridNumbers,
    position: Floats,
    target: Floats,
    max_time: float,
    v_max: float,
    moves: float,
) -> None:
    """Raise the times of the disc's cells in `learned` (A, B) to what a search found, or to the least that it allows.

    corner: index of the grid's frame in `learned`. times (W, W): see `travel_times`, which has searched all ways of
    up to `max_time` [s] from the robot at `position` (2,) to the target (2,). A cell without a time therefore takes at
    least `max_time`, less the time of the straight way from the robot, to within the time for one cell. Outside of an
    ellipse, this is no more than the straight way to the target takes, even if the target `moves` [m]: cells there are
    left out.
    """
    low_x, low_y, cell, size = grid
    # Robot and target as (row, column); the disc and the ellipse bound the columns of each row.
    x, y = (position[0] - low_x) / cell + 0.5, (position[1] - low_y) / cell + 0.5
    to_x, to_y = (target[0] - low_x) / cell + 0.5, (target[1] - low_y) / cell + 0.5
    ellipse = _ellipse(x, y, to_x, to_y, (max_time * v_max + moves) / cell)
    middle, radius, cell_time = 0.5 * (size + 1.0), disc_radius(size), cell / v_max
    for i in range(1, size + 1):
        half = math.sqrt(max(radius * radius - (i - middle) ** 2, 0.0))
        low, high = _columns(i, ellipse)
        first_column, last_column = math.ceil(max(middle - half, low)), int(min(middle + half, high))
        if first_column > last_column:
            continue
        row_learned = learned[corner[0] + i, corner[1] + first_column : corner[1] + last_column + 1]
        row_times = times[i, first_column : last_column + 1]
        # row_learned = max(row_learned, min(row_times, max_time − straight time from the robot)).
        across = (i - x) ** 2
        for n in range(len(row_learned)):  # without branches, for the processor's vectors
            along = first_column + n - y
            lower_bound = max_time - math.sqrt(across + along * along) * cell_time
            time = row_times[n] if row_times[n] < lower_bound else lower_bound
            row_learned[n] = time if time > row_learned[n] else row_learned[n]


@njit(cache=True, error_model="numpy")
def _ellipse(x, y, to_x, to_y, length):
    """Ellipse of the places on ways of a length between two others [cells].

    Returns its centre, and a, b, c of a x² + 2 b x y + c y² ≤ 1 about the centre.
    """
    distance = math.hypot(to_x - x, to_y - y)
    cos, sin = ((to_x - x) / distance, (to_y - y) / distance) if distance > 0.0 else (1.0, 0.0)
    # Inverse squares of the half axes: length / 2, and √(length² − apart²) / 2.
    along, across = 4.0 / length**2, 4.0 / max(length**2 - distance**2, 1e-9)
    a, c = cos * cos * along + sin * sin * across, sin * sin * along + cos * cos * across
    b = cos * sin * (along - across)
    return 0.5 * (x + to_x), 0.5 * (y + to_y), a, b, c


@njit(cache=True, error_model="numpy")
def _columns(row, ellipse):
    """First and last column of the ellipse in a row; the last is before the first if there is none."""
    x, y, a, b, c = ellipse
    offset = row - x
    # Solve a offset² + 2 b offset s + c s² = 1 for the columns y + s.
    root = (b * offset) ** 2 - c * (a * offset * offset - 1.0)
    if root < 0.0:
        return 1.0, 0.0
    return y - (b * offset + math.sqrt(root)) / c, y - (b * offset - math.sqrt(root)) / c


class LearnedTimes:
    """Least time to the target from each cell that was ever in reach [s], in the carried frame; 0 for all others.

    A search gives the time of the cells that it visited, and a lower bound for those that it had no reason to visit.
    Such times only rise, as in Learning Real-Time A* (Korf 1990), in the form of Real-Time Adaptive A* (Koenig and
    Likhachev 2006, AAMAS, DOI 10.1145/1160633.1160682). When a cell is later at the edge of the disc, and the points
    around it are no longer known, it still has its time. A dead end that is longer than the reach of the memory is
    therefore not entered again and again. The array grows with the way, in steps of the disc's width.
    """

    def __init__(self) -> None:
        self._times = np.zeros((0, 0))
        self._first = 0, 0  # index of the first cell

    def around(self, grid: Grid) -> Learned:
        """Return the times and the grid's corner in them; the caller may change those of the grid's cells."""
        width = grid.size + 2
        low = round(grid.x / grid.cell) - 1, round(grid.y / grid.cell) - 1
        corner = low[0] - self._first[0], low[1] - self._first[1]
        rows, columns = self._times.shape
        if 0 <= corner[0] <= rows - width and 0 <= corner[1] <= columns - width:
            return self._times, corner
        # Grow by whole widths of the disc, on every side where the frame is outside.
        if not self._times.size:
            self._first = low
        pads, first = [], []
        for low_index, start, count in zip(low, self._first, self._times.shape, strict=True):
            pad_before, pad_after = max(start - low_index, 0), max(low_index + width - start - count, 0)
            pads.append((-(-pad_before // width) * width, -(-pad_after // width) * width))
            first.append(start - pads[-1][0])
        self._times, self._first = np.pad(self._times, pads), (first[0], first[1])
        return self._times, (low[0] - self._first[0], low[1] - self._first[1])

    def learn(
        self, times: Floats, grid: Grid, position: Floats, target: Floats, max_time: float, v_max: float
    ) -> None:
        """Learn from the `times` (W, W) of a search of ways from `position` to `target` of up to `max_time` [s]."""
        moves = 2.0 * OTHER_TARGET
        learn(*self.around(grid), times, (*grid,), position, target, max_time, v_max, moves)


class StuckPlaces:
    """Places on the fastest way in front of which no candidate could be reached, in the carried frame.

    A body that is longer than wide may not fit where a disc of its inner radius does, so the expected times do not
    know of such places until the robot has tried them. The way through a place is then longer by `_COST` times the
    time that the robot was stuck before it. Eventually the robot takes another way, however much longer that is.

    rows: (S, 6) x, y [m], velocity 0, radius [m] and time per metre [s/m], as `travel_times` takes people.
    """

    def __init__(self, dt: float) -> None:
        """dt: control period [s]."""
        self._dt = dt
        self.forget()

    def forget(self) -> None:
        """Forget all places, for another target."""
        self._places, self._waited = np.empty((0, 2)), np.empty(0)  # [m], and the time stuck before each [s]
        self.rows: Floats = np.empty((0, 6))

    def wait(self, position: Floats) -> None:
        """Count one control period in which the robot is stuck before a position (2,) [m]."""
        distances = distances_to(self._places, position)
        if len(distances) and distances.min() < _PLACE_DISTANCE:
            self._waited[distances.argmin()] += self._dt
        else:
            self._places = np.vstack((self._places, position))
            self._waited = np.append(self._waited, self._dt)
        is_stuck = self._waited > _MIN_WAIT
        slower = _COST * self._waited[is_stuck] / (2.0 * _RADIUS)
        self.rows = np.column_stack(
            (self._places[is_stuck], np.zeros((len(slower), 2)), np.full(len(slower), _RADIUS), slower)
        )
