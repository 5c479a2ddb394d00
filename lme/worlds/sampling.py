"""Free space of a floor plan on a lattice: the places where a robot can be, and the shortest paths between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from lme.errors import InputError, argument_error
from lme.types import Floats, Ints, Pose
from lme.worlds.lattice import clearance_field, inside, shortest_path, shortest_way
from lme.worlds.world import FloorPlan

MAX_POINTS = 32_000_000  # of the lattice, which takes about 30 bytes for each
_LONG = 1000.0  # [m] no map is longer
STARTS_TRIED = 100  # before the plan counts as too small for the least distance

Points = NDArray[np.int32]  # indices in the flat lattice


class Configuration(NamedTuple):
    """A start and a goal (2,) [m] of an episode (paper §IV.A)."""

    start: Pose
    goal: Floats


class FreeSpace:
    """The points of a lattice and their clearance, for a robot of collision radius `radius` [m].

    A point is free if its clearance is at least `radius`. The robot can go from one free point to another if a
    chain of free neighbours joins them. Drawn starts and goals have `margin` [m] more clearance.
    """

    def __init__(self, plan: FloorPlan, step: float, radius: float, margin: float) -> None:
        """Measure the clearance of all points.

        step: distance between neighbouring points [m]. Raises InputError if the plan is too large for it.
        """
        low, high = plan.outline.min(axis=0), plan.outline.max(axis=0)
        columns, rows = _points_along(low.tolist(), high.tolist(), step)
        self._x = low[0] + (np.arange(columns) + 0.5) * step
        self._y = low[1] + (np.arange(rows) + 0.5) * step
        self._plan, self._step, self._radius = plan, step, radius
        self.clearance = clearance_field(plan, self._x, self._y, radius + margin)
        self._passable = self.clearance >= radius
        self._regions = np.empty(self._passable.shape, dtype=np.int32)
        ndimage.label(self._passable, output=self._regions)
        self._roomy: Points = np.flatnonzero(self.clearance >= radius + margin).astype(np.int32)
        self._lengths: dict[tuple[tuple[int, int], tuple[int, int]], float] = {}

    def draw(self, rng: np.random.Generator, min_distance: float) -> Configuration:
        """Draw a start of any yaw and a goal that can be reached from it, at least `min_distance` [m] apart.

        Raises InputError if there are none.
        """
        for _ in range(STARTS_TRIED if len(self._roomy) else 0):
            start = self._point(self._roomy[rng.integers(len(self._roomy))])
            goals = self._goals(start, min_distance)
            if len(goals):
                goal = self._point(goals[rng.integers(len(goals))])
                x, y = self._coordinates(start).tolist()
                return Configuration(Pose(x, y, rng.uniform(-math.pi, math.pi)), self._coordinates(goal))
        raise self._too_small(min_distance)

    def draw_partner(self, rng: np.random.Generator, position: Floats, min_distance: float) -> Floats:
        """Draw a position (2,) [m] that can be reached from a free `position` (2,), at least `min_distance` away.

        Raises InputError if there is none.
        """
        partners = self._goals(self._cell(position), min_distance)
        if not len(partners):
            raise self._too_small(min_distance)
        return self._coordinates(self._point(partners[rng.integers(len(partners))]))

    def check_free(self, subject: str, position: Floats | Sequence[float]) -> None:
        """Raise InputError, which begins with `subject`, unless the robot can be at `position`, x, y [m]."""
        x, y = position[0], position[1]
        outline = self._plan.outline
        if not inside(outline, np.array([x], dtype=np.float64), np.array([y], dtype=np.float64)).any():
            raise InputError(f"{subject} is ({x:g}, {y:g}), outside the map: must lie {self._plan.region}")
        if not self._passable[*self._cell(position)]:
            raise InputError(
                f"{subject} is ({x:g}, {y:g}), in an obstacle or too near one: must be at least {self._radius:.3g} m, "
                "the map set's radius, from every obstacle"
            )

    def checked_length(self, subject: str, start: Pose, goal: Floats) -> float:
        """Length of the shortest path on the lattice [m].

        Raises InputError, which begins with `subject`, unless start and goal are free and a path joins them.
        """
        self.check_free(f"{subject}: the start", start)
        self.check_free(f"{subject}: the goal", goal)
        length = self.path_length(start, goal)
        if not math.isfinite(length):
            raise InputError(
                f"{subject}: no path from the start to the goal is wide enough for a disc of "
                f"{self._radius:.3g} m, the map set's radius: must be a smaller robot, or a different start, goal or "
                "map"
            )
        return length

    def path_length(self, start: Pose, goal: Floats) -> float:
        """Length of the shortest path on the lattice [m]; inf if there is none. Computed once for each pair."""
        ends = self._cell(start[:2]), self._cell(goal)
        if not all(self._passable[*cell] for cell in ends):
            return math.inf
        pair = (tuple(ends[0].tolist()), tuple(ends[1].tolist()))
        if pair not in self._lengths:
            self._lengths[pair] = shortest_path(self._passable, self._step, *ends)
        return self._lengths[pair]

    def way(self, start: Floats, goal: Floats) -> Floats:
        """(N, 2) points at which a shortest path turns, both places (2,) included [m]; N = 0 if there is none."""
        points = shortest_way(self._passable, self._step, self._cell(start), self._cell(goal))
        if not len(points):
            return np.empty((0, 2))
        turns = np.column_stack([self._x[points[1:-1, 1]], self._y[points[1:-1, 0]]])
        return np.vstack([start, turns, goal])

    def area(self, position: Floats | Sequence[float]) -> float:
        """Area of the free points that can be reached from a free position x, y [m²]."""
        region = self._regions[*self._cell(position)]
        return float(np.count_nonzero(self._regions == region)) * self._step**2 if region else 0.0

    def _too_small(self, min_distance: float) -> InputError:
        if not len(self._roomy):
            return argument_error(
                f"radius is {self._radius:.3g} m: no point of this map is so far from all obstacles, with the margin "
                "added; is the map inverted, or does it consist of unknown cells?"
            )
        return argument_error(
            f"min_distance is {min_distance:g} m: must be a distance that start and goal can have in the "
            f"free space that radius and margin leave ({len(self._roomy)} points of this map)"
        )

    def _goals(self, start: Ints, min_distance: float) -> Points:
        """(G,) roomy points that can be reached from the start [row, column], far enough away."""
        goals: Points = _reachable(
            self._roomy, self._regions, int(start[0]), int(start[1]), self._step, min_distance - 1e-9
        )
        return goals

    def _point(self, flat: int) -> Ints:
        """[row, column] of a point of the flat lattice."""
        return np.array(divmod(int(flat), len(self._x)))

    def _coordinates(self, point: Ints) -> Floats:
        return np.array([self._x[point[1]], self._y[point[0]]])

    def _cell(self, point: Floats | Sequence[float]) -> Ints:
        """(2,) row and column of the point nearest to a place x, y [m]; of a free point if the place is free."""
        x, y = point[0], point[1]
        column = int(np.clip(round((x - self._x[0]) / self._step), 0, len(self._x) - 1))
        row = int(np.clip(round((y - self._y[0]) / self._step), 0, len(self._y) - 1))
        cell = np.array([row, column])
        if self._passable[row, column]:
            return cell
        # The nearest point is not free. If the place itself is, take the nearest of the free points around.
        candidates = np.argwhere(self._passable[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2])
        coordinates = np.array([x], dtype=np.float64), np.array([y], dtype=np.float64)
        clearance = clearance_field(self._plan, *coordinates, self._radius)
        if clearance.item() < self._radius or not len(candidates):
            return cell
        candidates += np.maximum(cell - 1, 0)
        distances = np.hypot(self._x[candidates[:, 1]] - x, self._y[candidates[:, 0]] - y)
        return np.asarray(candidates[distances.argmin()])


def _points_along(low: list[float], high: list[float], step: float) -> tuple[int, int]:
    """Columns and rows of a lattice between two corners. Raises InputError if they are too many."""
    width, height = high[0] - low[0], high[1] - low[1]
    points = (width / step) * (height / step)
    if not points <= MAX_POINTS:
        hint = "; are the map's lengths in millimetres or centimetres?" if max(width, height) > _LONG else ""
        raise argument_error(
            f"grid is {step:g} m for a map of {width:g} by {height:g} m: must give at most {MAX_POINTS} "
            f"points, so at least {step * math.sqrt(points / MAX_POINTS):.2g} m{hint}"
        )
    return math.ceil(width / step - 1e-9), math.ceil(height / step - 1e-9)


@njit(cache=True, error_model="numpy")
def _reachable(
    roomy: Points, regions: NDArray[np.int32], row: int, column: int, step: float, min_distance: float
) -> Points:
    """Return the points of `roomy` in the region of [row, column], except itself, at least `min_distance` [m] away."""
    reachable, count = np.empty_like(roomy), 0
    sure_square = (min_distance / step) ** 2 * (1.0 + 1e-9)  # spares most points the root
    for point in roomy:
        # A point can be reached if it lies in the same region of free neighbours.
        row_index, column_index = point // regions.shape[1], point % regions.shape[1]
        if regions[row_index, column_index] != regions[row, column]:
            continue
        # Far enough if √(Δrow² + Δcolumn²) step ≥ min_distance; most points surely are, by the square.
        rows, columns = row_index - row, column_index - column
        square = rows * rows + columns * columns
        if square > 0 and (square > sure_square or math.hypot(rows, columns) * step >= min_distance):
            reachable[count] = point
            count += 1
    return reachable[:count]
