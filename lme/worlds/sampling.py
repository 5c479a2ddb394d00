"""Free space of a floor plan on a lattice: where a robot can be, where it can go, and how long the way is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from lme.errors import InputError
from lme.types import Bools, Floats, Ints, Pose
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.lattice import shortest_path

MAX_POINTS = 1_000_000  # of the lattice
STARTS_TRIED = 100  # before the plan counts as too small for the least distance


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
        """step: distance between neighbouring points [m]. Raises InputError if the plan is too large for it."""
        low, high = plan.outline.min(axis=0), plan.outline.max(axis=0)
        columns, rows = _points_along(low.tolist(), high.tolist(), step)
        self._x = low[0] + (np.arange(columns) + 0.5) * step
        self._y = low[1] + (np.arange(rows) + 0.5) * step
        self._plan, self._step, self._radius = plan, step, radius
        self.clearance = clearance_field(plan, self._x, self._y, radius + margin)
        self._passable = self.clearance >= radius
        self._regions, _ = ndimage.label(self._passable)
        self._roomy = np.argwhere(self.clearance >= radius + margin)
        self._lengths: dict[tuple[tuple[int, int], tuple[int, int]], float] = {}

    def draw(self, rng: np.random.Generator, min_distance: float) -> Configuration:
        """Draw a start of any yaw and a goal that can be reached from it, at least `min_distance` [m] apart.

        Raises InputError if there are none.
        """
        for _ in range(STARTS_TRIED if len(self._roomy) else 0):
            start = self._roomy[rng.integers(len(self._roomy))]
            goals = self._goals(start, min_distance)
            if len(goals):
                goal = goals[rng.integers(len(goals))]
                x, y = self._place(start).tolist()
                return Configuration(Pose(x, y, rng.uniform(-math.pi, math.pi)), self._place(goal))
        raise self._too_small(min_distance)

    def draw_partner(self, rng: np.random.Generator, place: Floats, min_distance: float) -> Floats:
        """Draw a place (2,) [m] that can be reached from a free `place` (2,), at least `min_distance` away.

        Raises InputError if there is none.
        """
        partners = self._goals(self._cell(place), min_distance)
        if not len(partners):
            raise self._too_small(min_distance)
        return self._place(partners[rng.integers(len(partners))])

    def check_free(self, what: str, place: Floats | Sequence[float]) -> None:
        """Raise InputError, which begins with `what`, unless the robot can be at `place`, x, y [m]."""
        x, y = place[0], place[1]
        outline = self._plan.outline
        if not _inside(outline, np.array([x]), np.array([y])).any():
            low, high = outline.min(axis=0), outline.max(axis=0)
            raise InputError(
                f"{what} is ({x:g}, {y:g}), outside the map: must lie in x {low[0]:g} to {high[0]:g} m, "
                f"y {low[1]:g} to {high[1]:g} m"
            )
        if not self._passable[*self._cell(place)]:
            raise InputError(
                f"{what} is ({x:g}, {y:g}), in an obstacle or too near one: must be at least {self._radius:.3g} m "
                "from every obstacle (map.radius)"
            )

    def checked_length(self, where: str, start: Pose, goal: Floats) -> float:
        """Length of the shortest path on the lattice [m].

        Raises InputError, which begins with `where`, unless start and goal are free and a path joins them.
        """
        self.check_free(f"{where}: the start", start)
        self.check_free(f"{where}: the goal", goal)
        length = self.path_length(start, goal)
        if not math.isfinite(length):
            raise InputError(
                f"{where}: no path from the start to the goal is wide enough for a disc of radius "
                f"{self._radius:.3g} m (map.radius): must be a smaller robot, or a different start, goal or map"
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

    def _too_small(self, min_distance: float) -> InputError:
        return InputError(
            f"map.min_distance is {min_distance:g} m: must be a distance that start and goal can have in the "
            f"free space that map.radius and map.margin leave ({len(self._roomy)} points of this map)"
        )

    def _goals(self, start: Ints, min_distance: float) -> Ints:
        """(G, 2) roomy points [row, column] that can be reached from the start [row, column], far enough away."""
        rows, columns = self._roomy.T
        same = self._regions[rows, columns] == self._regions[*start]
        away = np.hypot(rows - start[0], columns - start[1]) * self._step >= min_distance - 1e-9
        apart = (self._roomy != start).any(axis=1)
        return np.asarray(self._roomy[same & away & apart])

    def _place(self, point: Ints) -> Floats:
        return np.array([self._x[point[1]], self._y[point[0]]])

    def _cell(self, place: Floats | Sequence[float]) -> Ints:
        """(2,) row and column of the point nearest to a place x, y [m]; if it is free, of a free point."""
        x, y = place[0], place[1]
        column = int(np.clip(round((x - self._x[0]) / self._step), 0, len(self._x) - 1))
        row = int(np.clip(round((y - self._y[0]) / self._step), 0, len(self._y) - 1))
        cell = np.array([row, column])
        if self._passable[row, column]:
            return cell
        around = np.argwhere(self._passable[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2])
        clearance = clearance_field(self._plan, np.array([x]), np.array([y]), self._radius)
        if clearance.item() < self._radius or not len(around):
            return cell
        around += np.maximum(cell - 1, 0)
        away = np.hypot(self._x[around[:, 1]] - x, self._y[around[:, 0]] - y)
        return np.asarray(around[away.argmin()])


def _points_along(low: list[float], high: list[float], step: float) -> tuple[int, int]:
    """Columns and rows of a lattice between two corners. Raises InputError if they are too many."""
    width, height = high[0] - low[0], high[1] - low[1]
    points = (width / step) * (height / step)
    if not points <= MAX_POINTS:
        raise InputError(
            f"map.grid is {step:g} m for a map of {width:g} by {height:g} m: must give at most {MAX_POINTS} "
            f"points, so at least {step * math.sqrt(points / MAX_POINTS):.2g} m"
        )
    return math.ceil(width / step - 1e-9), math.ceil(height / step - 1e-9)


def clearance_field(plan: FloorPlan, x: Floats, y: Floats, reach: float) -> Floats:
    """(Y, X) distance of each lattice point to the nearest obstacle [m], at most `reach`.

    Zero in solid obstacles and outside the plan's outline. x (X,) and y (Y,) rise evenly [m].
    """
    field = np.where(_inside(plan.outline, x, y), reach, 0.0)
    for centre_x, centre_y, radius in plan.world.circles:
        box = _window(x, y, [(centre_x, centre_y)], radius + reach)
        away = np.hypot(x[box[1]] - centre_x, y[box[0]][:, None] - centre_y) - radius
        field[box] = np.minimum(field[box], np.maximum(away, 0.0))
    for edge in plan.world.edges:
        box = _window(x, y, edge.reshape(2, 2), reach)
        field[box] = np.minimum(field[box], _to_segment(edge, x[box[1]], y[box[0]][:, None]))
    for polygon in plan.world.polygons:
        box = _window(x, y, polygon, 0.0)
        field[box][_inside(polygon, x[box[1]], y[box[0]])] = 0.0
    return field


def _window(x: Floats, y: Floats, points: object, reach: float) -> tuple[slice, slice]:
    """Rows and columns of the lattice within `reach` of the box around points."""
    low, high = np.min(points, axis=0) - reach, np.max(points, axis=0) + reach  # type: ignore[call-overload]
    columns = np.searchsorted(x, [low[0], high[0]], side="left")
    rows = np.searchsorted(y, [low[1], high[1]], side="left")
    return slice(rows[0], rows[1]), slice(columns[0], columns[1])


def _to_segment(edge: Floats, x: Floats, y: Floats) -> Floats:
    """Distances of lattice points to one segment (4,)."""
    ex, ey = edge[2] - edge[0], edge[3] - edge[1]
    dx, dy = x - edge[0], y - edge[1]
    square = ex * ex + ey * ey
    share = np.clip((dx * ex + dy * ey) / square, 0.0, 1.0) if square > 0.0 else 0.0
    return np.asarray(np.hypot(dx - share * ex, dy - share * ey))


def _inside(polygon: Floats, x: Floats, y: Floats) -> Bools:
    """(Y, X) whether each lattice point lies in a polygon: an odd number of sides lies to its left in its row."""
    flips = np.zeros((len(y), len(x) + 1), dtype=np.int64)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        rows = np.flatnonzero((y0 > y) != (y1 > y))
        if len(rows):
            at = x0 + (y[rows] - y0) * ((x1 - x0) / (y1 - y0))
            flips[rows, np.searchsorted(x, at, side="left")] += 1
    return np.asarray(np.cumsum(flips[:, :-1], axis=1) % 2 == 1)
