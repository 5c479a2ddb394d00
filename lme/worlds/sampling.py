"""Free space of a floor plan on a lattice: where a robot may start, where it can get to, and how far that is."""

from __future__ import annotations

import math
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from lme.errors import InputError
from lme.types import Bools, Floats, Ints, Pose
from lme.worlds.floor_plan import FloorPlan

MAX_POINTS = 1_000_000  # of the lattice: the graph of shortest paths takes about 0.5 KB for each
STARTS_TRIED = 100  # before a plan counts as too small for the least distance

_MOVES = {  # (columns, rows) of a move: the points that it passes between, all of which must be free
    (1, 0): (),
    (1, 1): ((1, 0), (0, 1)),
    (2, 1): ((1, 0), (1, 1)),
    (3, 1): ((1, 0), (1, 1), (2, 0), (2, 1)),
    (3, 2): ((1, 0), (1, 1), (2, 1), (2, 2)),
}  # with their mirror images 32 directions: a path is at most 1.3 % longer than the straight line
_REACH = 3  # columns or rows of the longest move


class Configuration(NamedTuple):
    """Where an episode starts and where it must end, (2,) [m] (paper §IV.A)."""

    start: Pose
    goal: Floats


class FreeSpace:
    """Points of a lattice with their clearance, for a robot of collision radius `radius` [m].

    The robot can be where the clearance is at least `radius`, and can go from one such point to another where
    a chain of neighbours joins them. Start and goal keep `margin` [m] more.
    """

    def __init__(self, plan: FloorPlan, step: float, radius: float, margin: float) -> None:
        """Lay points `step` [m] apart over the plan. Raises InputError where it is far too large for that."""
        low, high = plan.outline.min(axis=0), plan.outline.max(axis=0)
        columns, rows = _points_along(low.tolist(), high.tolist(), step)
        self._x = low[0] + (np.arange(columns) + 0.5) * step
        self._y = low[1] + (np.arange(rows) + 0.5) * step
        self._step = step
        self.clearance = clearance_field(plan, self._x, self._y, radius + margin)
        self._passable = self.clearance >= radius
        self._regions, _ = ndimage.label(self._passable)
        self._roomy = np.argwhere(self.clearance >= radius + margin)

    def draw(self, rng: np.random.Generator, min_distance: float) -> Configuration:
        """A start and a goal that can be reached from it, at least `min_distance` apart, any start yaw.

        Raises InputError where there are none.
        """
        for _ in range(STARTS_TRIED if len(self._roomy) else 0):
            start = self._roomy[rng.integers(len(self._roomy))]
            goals = self._goals(start, min_distance)
            if len(goals):
                goal = goals[rng.integers(len(goals))]
                x, y = self._place(start).tolist()
                return Configuration(Pose(x, y, rng.uniform(-math.pi, math.pi)), self._place(goal))
        raise InputError(
            f"map.min_distance is {min_distance:g} m: must be a distance that start and goal can have in the "
            f"free space that map.radius and map.margin leave ({len(self._roomy)} points of this map)"
        )

    def path_length(self, start: Pose, goal: Floats) -> float:
        """Length of the shortest path on the lattice [m]; inf if there is none. Both must be lattice points."""
        first, last = self._node(start[:2]), self._node(goal)
        if min(first, last) < 0:
            return math.inf
        lengths = dijkstra(self._graph, directed=False, indices=np.array([first]))
        return float(lengths[0, last])

    def _goals(self, start: Ints, min_distance: float) -> Ints:
        """(G, 2) roomy points [row, column] of the start's region, far enough away."""
        rows, columns = self._roomy.T
        same = self._regions[rows, columns] == self._regions[*start]
        away = np.hypot(rows - start[0], columns - start[1]) * self._step >= min_distance - 1e-9
        apart = (self._roomy != start).any(axis=1)
        return np.asarray(self._roomy[same & away & apart])

    def _place(self, point: Ints) -> Floats:
        return np.array([self._x[point[1]], self._y[point[0]]])

    def _node(self, place: tuple[float, ...] | Floats) -> int:
        """Number of the free point at a place, −1 if it is not free."""
        column = int(np.clip(round((place[0] - self._x[0]) / self._step), 0, len(self._x) - 1))
        row = int(np.clip(round((place[1] - self._y[0]) / self._step), 0, len(self._y) - 1))
        return int(self._nodes[row, column])

    @cached_property
    def _nodes(self) -> NDArray[np.int32]:
        """(rows, columns) numbers of the free points, −1 elsewhere."""
        nodes = np.full(self._passable.shape, -1, dtype=np.int32)
        nodes[self._passable] = np.arange(self._passable.sum())
        return nodes

    @cached_property
    def _graph(self) -> csr_array:
        """Each pair of free points that one move joins, once, with its length [m]."""
        nodes = np.pad(self._nodes, _REACH, constant_values=-1)
        joined = [_joined(nodes, move, between) for move, between in _all_moves().items()]
        pairs = np.hstack([pair for pair, _ in joined])
        lengths = np.concatenate([np.full(pair.shape[1], length * self._step) for pair, length in joined])
        count = int(self._passable.sum())
        return coo_array((lengths, (pairs[0], pairs[1])), shape=(count, count)).tocsr()


def _points_along(low: list[float], high: list[float], step: float) -> tuple[int, int]:
    """Columns and rows of a lattice between two corners. Raises InputError where that is far too many."""
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
    """(Y, X) lattice points in a polygon, by the even–odd rule, row by row: what is left of how many sides."""
    flips = np.zeros((len(y), len(x) + 1), dtype=np.int64)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        rows = np.flatnonzero((y0 > y) != (y1 > y))
        if len(rows):
            at = x0 + (y[rows] - y0) * ((x1 - x0) / (y1 - y0))
            flips[rows, np.searchsorted(x, at, side="left")] += 1
    return np.asarray(np.cumsum(flips[:, :-1], axis=1) % 2 == 1)


def _all_moves() -> dict[tuple[int, int], list[tuple[int, int]]]:
    """One of each pair of opposite moves in 32 directions, with the points passed."""
    moves = {}
    for move, between in _MOVES.items():
        for swap in (False, True):
            for sign in (1, -1):
                turned = [_turned(point, swap, sign) for point in (move, *between)]
                moves[turned[0]] = turned[1:]
    return {
        move: passed for move, passed in moves.items() if (-move[0], -move[1]) not in moves or move > (0, 0)
    }


def _turned(point: tuple[int, int], swap: bool, sign: int) -> tuple[int, int]:
    column, row = point[::-1] if swap else point
    return column, sign * row


def _joined(
    nodes: NDArray[np.int32], move: tuple[int, int], between: list[tuple[int, int]]
) -> tuple[NDArray[np.int32], float]:
    """(2, J) free points that a move joins, and its length in steps."""
    origin = _shifted(nodes, (0, 0))
    target = _shifted(nodes, move)
    free = (origin >= 0) & (target >= 0)
    for point in between:
        free &= _shifted(nodes, point) >= 0
    return np.array([origin[free], target[free]]), math.hypot(*move)


def _shifted(nodes: NDArray[np.int32], move: tuple[int, int]) -> NDArray[np.int32]:
    """What lies a move away from each point of the lattice; nodes carry a border of _REACH."""
    column, row = move
    rows, columns = nodes.shape
    return nodes[_REACH + row : rows - _REACH + row, _REACH + column : columns - _REACH + column]
