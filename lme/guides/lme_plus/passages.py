"""Width of the passage in which a cell lies, by the points on both of its sides."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.guides.lme_plus.travel_grid import HALF_DIAGONAL, Grid, SpeedProfile
from lme.types import Floats

_ONE_SIDED = 0.9  # share of a step away from points on one side alone by which they become farther, at least


@njit(cache=True, error_model="numpy")
def half_width(
    i: int,
    j: int,
    squares: Floats,
    border: int,
    obstacles: tuple[Floats, NDArray[np.int32], NDArray[np.int32]],
    grid: Grid,
    pace: SpeedProfile,
) -> float:
    """Half of the distance between the points on both sides of a cell [m]; 0 if it is in no narrow passage.

    The cell is in row i and column j of the grid, from 0. squares, and obstacles, which are points (M, 2), following
    (M,) and first (size, size): see `nearest_points.draw`; `border` cells of squares are around the grid. One of the
    two points is the nearest in the grid to the cell's centre, at least half a cell away. The other is on the other
    side: the angle between them is more than a right one, and they are less than 2 `inner` apart.
    """
    (points, following, first), (low_x, low_y, cell, size) = obstacles, grid
    square = squares[i + border, j + border]
    x, y = low_x + (i + 0.5) * cell, low_y + (j + 0.5) * cell
    # Direction and squared distance of the nearest point.
    ax, ay, nearest = 0.0, 0.0, np.inf
    reach = int(math.sqrt(square) + 0.5)
    for a in range(max(i - reach, 0), min(i + reach + 1, size)):
        for b in range(max(j - reach, 0), min(j + reach + 1, size)):
            m = first[a, b]
            while m >= 0:
                dx, dy = points[m, 0] - x, points[m, 1] - y
                point_square = dx * dx + dy * dy
                if point_square < nearest:
                    ax, ay, nearest = dx, dy, point_square
                m = following[m]
    if nearest < 0.25 * cell * cell:
        return 0.0
    # Least distance from that point to one on the other side.
    max_square = 4.0 * pace.inner * pace.inner
    side = HALF_DIAGONAL * math.sqrt(nearest)
    width, reach = max_square, int(2.0 * pace.inner / cell + 0.5)
    for a in range(max(i - reach, 0), min(i + reach + 1, size)):
        for b in range(max(j - reach, 0), min(j + reach + 1, size)):
            # Skip cells that lie wholly on the side of the first point.
            if (a - i) * ax + (b - j) * ay > side:
                continue
            m = first[a, b]
            while m >= 0:
                dx, dy = points[m, 0] - x, points[m, 1] - y
                if dx * ax + dy * ay < 0.0:
                    width = min(width, (dx - ax) ** 2 + (dy - ay) ** 2)
                m = following[m]
    return 0.5 * math.sqrt(width) if width < max_square else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def may_be_passage(squares, i, j, tight, comfort):
    """Return whether a cell can be in a narrow passage.

    tight, comfort: as in `SpeedProfile`, in cells. i, j: the cell, in `squares`.

    It cannot if all places in it are less than `tight` from a point, or if the points are on one side alone: then the
    nearest is farther from one of twelve cells about 2 cells away, by nearly all of the way there.
    """
    square = squares[i, j]
    min_distance = max(tight - HALF_DIAGONAL, 0.5)
    if square < min_distance * min_distance:
        return False
    distance = math.sqrt(square)
    # Four cells 2 away along the axes, then eight that are √5 away.
    straight = min(distance + _ONE_SIDED * 2.0, comfort) ** 2
    if max(squares[i - 2, j], squares[i + 2, j], squares[i, j - 2], squares[i, j + 2]) >= straight:
        return False
    aslant = min(distance + _ONE_SIDED * math.sqrt(5.0), comfort) ** 2
    rows = max(squares[i - 2, j - 1], squares[i - 2, j + 1], squares[i + 2, j - 1], squares[i + 2, j + 1])
    columns = max(squares[i - 1, j - 2], squares[i - 1, j + 2], squares[i + 1, j - 2], squares[i + 1, j + 2])
    return max(rows, columns) < aslant
