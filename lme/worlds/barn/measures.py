"""The five difficulty measures of a BARN world, averaged along the benchmark's path.

They are measured on the inflated grid; lengths are in cells of 0.15 m, as the benchmark publishes them.
Source: Perille et al. 2020, arXiv:2008.13315, section on difficulty metrics.
"""

from __future__ import annotations

import math

import numpy as np

from lme.types import Bools, Ints
from lme.worlds.barn.path import obstacle_distance

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

Walls = list[list[bool]]


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
