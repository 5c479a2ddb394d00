"""The benchmark's own path through a BARN world, and the five measures of difficulty along it.

The published `path_N.npy` are reproduced cell for cell. The measures are averages along the path on the inflated grid,
with lengths in cells of 0.15 m, as the benchmark publishes them. Source: Perille et al. 2020, arXiv:2008.13315.
"""

from __future__ import annotations

import hashlib
import heapq
import math
import random
from collections.abc import Callable

import numpy as np
from scipy import ndimage

from lme.types import Bools, Floats, Ints, Pose
from lme.worlds.barn.generator import CELL_M, GRID_CELLS

ROBOT_CELLS = 2  # cells that the benchmark's Jackal occupies on each side of its own
OPTIMAL_SPEED_M_S = 2.0

# The benchmark's scoring scripts place cell (0, 0) of a path here, (−0.15, −0.10) m from its true centre.
_PATH_X_M, _PATH_Y_M = -4.575, 5.075

_PENALTY, _PENALTY_CELLS = 5.0, 2.0
# Neighbouring directions differ by 45°.
_DIRECTIONS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))

_AXES = ((0, 1), (1, 1), (1, 0), (1, -1))
_RAYS = _AXES + tuple((-dr, -dc) for dr, dc in _AXES)
# Sixteen directions around a cell, quarter by quarter. Two errors of the benchmark are needed to reproduce the
# published figures: the two knight's moves of the third quarter are swapped, and only those knight's moves that
# contain +2 count as two cells; those that contain −2 count as one.
_SIXTEEN = (
    *((0, 1), (1, 2), (1, 1), (2, 1)),
    *((1, 0), (2, -1), (1, -1), (1, -2)),
    *((0, -1), (-2, -1), (-1, -1), (-1, -2)),
    *((-1, 0), (-2, 1), (-1, 1), (-1, 2)),
)
_DISPERSION_CELLS = 3

Cell = tuple[int, int]
Walls = list[list[bool]]


def inflated(grid: Bools) -> Bools:
    """(30, 30) cells where the robot's centre cannot be: a cell of the 5 × 5 around is filled."""
    size = 2 * ROBOT_CELLS + 1
    return np.asarray(ndimage.maximum_filter(grid, size=size, mode="constant", cval=0), dtype=np.bool_)


def obstacle_distance(blocked: Bools) -> Floats:
    """(30, 30) distance from each cell to the nearest blocked one [cells]."""
    return np.asarray(ndimage.distance_transform_edt(~blocked), dtype=np.float64)


def random_path(blocked: Bools, rng: random.Random) -> Ints | None:
    """Path between rows drawn from the world's own random stream, left before right; None if there is no way."""
    return _path_through(blocked, lambda rows: rows[int(rng.random() * len(rows))])


def middle_path(blocked: Bools) -> Ints | None:
    """Path between the free rows nearest to the middle, for worlds without a random stream; None as above."""
    return _path_through(blocked, lambda rows: min(rows, key=lambda row: abs(row - (GRID_CELLS - 1) / 2)))


def plan(blocked: Bools, start: Cell, goal: Cell) -> Ints | None:
    """(K, 2) cells from start to goal, the start twice as in the published files; None if there is no way.

    Best-first search over eight neighbours, with turns of at most 45°, no passage between two blocked cells that
    touch at a corner, and a penalty of 5/d within 2 cells of an obstacle. To reproduce the published paths, a
    cell's first rank is the length of the way to it and its penalty. When a shorter way to it is found, the straight
    distance to the goal is added. The cost of the cells that follow contains neither distance nor penalty.
    """
    walls, nearness = blocked.tolist(), _penalties(blocked)
    parents: dict[Cell, Cell | None] = {start: None}
    costs, ranks, order = {start: 0.0}, {start: 0.0}, {start: 0}
    heap, closed = [(0.0, 0, start)], set[Cell]()
    while heap:
        # Skip a cell that was closed before, or that has another rank by now.
        rank, _, cell = heapq.heappop(heap)
        if cell in closed or rank != ranks[cell]:
            continue
        closed.add(cell)
        if cell == goal:
            return _trace(parents, goal)
        for child, step in _moves(walls, cell, parents[cell]):
            cost = costs[cell] + step
            is_open = child in costs
            if child in closed or (is_open and cost >= costs[child]):
                continue
            # The rank is the cost and the penalty, and for a cell that was reached before the straight distance too.
            costs[child], parents[child] = cost, cell
            ranks[child] = cost + nearness[child[0]][child[1]] + (math.dist(child, goal) if is_open else 0.0)
            heapq.heappush(heap, (ranks[child], order.setdefault(child, len(order)), child))
    return None


def benchmark_length(path: Ints, start: Pose, goal: Floats) -> float:
    """Length of the polyline of start, path (K, 2) and goal [m], as the benchmark's scoring scripts measure it."""
    cells = np.column_stack([_PATH_X_M + CELL_M * path[:, 0], _PATH_Y_M + CELL_M * path[:, 1]])
    points = np.vstack([[start.x, start.y], cells, goal])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def path_digest(path: Ints) -> str:
    """SHA-256 of one line "row column" per cell, in order."""
    return hashlib.sha256("".join(f"{r} {c}\n" for r, c in path.tolist()).encode("ascii")).hexdigest()


def _path_through(blocked: Bools, choose: Callable[[list[int]], int]) -> Ints | None:
    """Path from the first column to the last, in the region that is the largest at both; None if none is."""
    if blocked.all(axis=0).any():  # a closed column; most attempts at a dense world end here
        return None
    regions, count = ndimage.label(~blocked)
    sizes = np.bincount(regions.ravel(), minlength=count + 1)
    sizes[0] = 0
    entry, leave = (max(regions[:, column].tolist(), key=lambda region: sizes[region]) for column in (0, -1))
    if entry != leave:
        return None
    left = choose(np.flatnonzero(regions[:, 0] == entry).tolist())
    right = choose(np.flatnonzero(regions[:, -1] == entry).tolist())
    return plan(blocked, (left, 0), (right, GRID_CELLS - 1))


def _penalties(blocked: Bools) -> list[list[float]]:
    distance = obstacle_distance(blocked)
    is_near = (distance > 0) & (distance <= _PENALTY_CELLS)
    penalties: list[list[float]] = np.divide(
        _PENALTY, distance, out=np.zeros_like(distance), where=is_near
    ).tolist()
    return penalties


def _moves(walls: Walls, cell: Cell, parent: Cell | None) -> list[tuple[Cell, float]]:
    """The free neighbours within a turn of 45°, each with the length of the step [cells]."""
    r, c = cell
    directions: tuple[Cell, ...] = _DIRECTIONS
    if parent is not None:
        ahead = _DIRECTIONS.index((r - parent[0], c - parent[1]))
        directions = tuple(_DIRECTIONS[(ahead + turn) % 8] for turn in (-1, 0, 1))
    moves = []
    for dr, dc in directions:
        if not (0 <= r + dr < GRID_CELLS and 0 <= c + dc < GRID_CELLS) or walls[r + dr][c + dc]:
            continue
        if not (walls[r + dr][c] and walls[r][c + dc]) or 0 in (dr, dc):
            moves.append(((r + dr, c + dc), math.hypot(dr, dc)))
    return moves


def _trace(parents: dict[Cell, Cell | None], goal: Cell) -> Ints:
    cells = [goal]
    while (parent := parents[cells[-1]]) is not None:
        cells.append(parent)
    return np.array([cells[-1], *reversed(cells)], dtype=np.int64)


def barn_measures(blocked: Bools, path: Ints) -> dict[str, float]:
    """The five measures by name. blocked: (30, 30) inflated grid; path: (K, 2) cells, all of them free."""
    return {
        "closest_wall": closest_wall(blocked, path),
        "avg_visibility": avg_visibility(blocked, path),
        "dispersion": dispersion(blocked, path),
        "characteristic_dimension": characteristic_dimension(blocked, path),
        "tortuosity": tortuosity(path),
    }


def closest_wall(blocked: Bools, path: Ints) -> float:
    """Mean distance from a path cell to the nearest blocked cell [cells]."""
    return float(obstacle_distance(blocked)[path[:, 0], path[:, 1]].mean())


def avg_visibility(blocked: Bools, path: Ints) -> float:
    """Mean visible distance over the path and over the directions of the eight neighbours [cells].

    A ray ends at a blocked cell or at the border of the grid; the cell itself counts as visible.
    """
    walls = blocked.tolist()
    return _mean(
        [sum(_length(ray, 1 + _free(walls, cell, ray)) for ray in _RAYS) / 8 for cell in path.tolist()]
    )


def characteristic_dimension(blocked: Bools, path: Ints) -> float:
    """Mean over the path of the least free width through a cell, of four axes [cells]."""
    walls = blocked.tolist()
    return _mean([min(_width(walls, cell, axis) for axis in _AXES) for cell in path.tolist()])


def dispersion(blocked: Bools, path: Ints) -> float:
    """Mean over the path of the number of changes between "wall" and "no wall" around a cell.

    There is a wall in a direction, of sixteen, if one lies within three cells.
    """
    walls = blocked.tolist()
    return _mean(
        [_alternations([_wall_near(walls, cell, ray) for ray in _SIXTEEN]) for cell in path.tolist()]
    )


def tortuosity(path: Ints) -> float:
    """Length of the path divided by the straight distance between its ends."""
    arc = np.hypot(*np.diff(path, axis=0).T).sum()
    return float(arc / math.dist(path[0], path[-1]))


def _free(walls: Walls, cell: list[int], ray: tuple[int, int], max_cells: int = 1000) -> int:
    """Number of free cells along a ray, without the first, up to a wall, the border or `max_cells`."""
    (r, c), (dr, dc) = cell, ray
    steps = 0
    while steps < max_cells and _inside(walls, r + dr, c + dc) and not walls[r + dr][c + dc]:
        r, c, steps = r + dr, c + dc, steps + 1
    return steps


def _wall_near(walls: Walls, cell: list[int], ray: tuple[int, int]) -> bool:
    max_cells = math.ceil(_DISPERSION_CELLS / max(1, *ray))
    stop = _free(walls, cell, ray, max_cells) + 1
    r, c = cell[0] + stop * ray[0], cell[1] + stop * ray[1]
    return stop <= max_cells and _inside(walls, r, c) and walls[r][c]


def _width(walls: Walls, cell: list[int], axis: tuple[int, int]) -> float:
    return _length(axis, _free(walls, cell, axis) + _free(walls, cell, (-axis[0], -axis[1])))


def _length(ray: tuple[int, int], steps: int) -> float:
    return math.hypot(*ray) * steps


def _alternations(ring: list[bool]) -> int:
    return sum(current != previous for previous, current in zip([ring[-1], *ring], ring, strict=False))


def _inside(walls: Walls, r: int, c: int) -> bool:
    return 0 <= r < len(walls) and 0 <= c < len(walls[0])


def _mean(values: list[float] | list[int]) -> float:
    return sum(values) / len(values)
