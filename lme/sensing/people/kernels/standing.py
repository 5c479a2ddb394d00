"""Memory of the places where something stood: a grid that wraps around, with the time of the last return."""

import math

import numpy as np
from numba import njit

CELLS = 512  # along a side
_CELL = 0.1  # [m]


@njit(cache=True, error_model="numpy")
def remember(stood, points, hits, owner, movers, time):
    """Note in `stood` (CELLS, CELLS) when something returned that is not known to move.

    points (B, 2), hits (B,), owner (B,): of a scan taken at `time` [s], with the track of each point.
    """
    for i in range(len(points)):
        if hits[i] and (owner[i] < 0 or not movers[owner[i] % len(movers)]):
            column, row = _cell(points[i, 0]), _cell(points[i, 1])
            stood[row % CELLS, column % CELLS] = time


@njit(cache=True, error_model="numpy")
def recall(stood, points, hits, since):
    """Whether each point (B, 2) is where something stood after a time [s]: (B,)."""
    stands = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if hits[i]:
            column, row = _cell(points[i, 0] - 0.5 * _CELL), _cell(points[i, 1] - 0.5 * _CELL)
            for k in range(2):
                for m in range(2):
                    stands[i] |= stood[(row + k) % CELLS, (column + m) % CELLS] >= since
    return stands


@njit(cache=True, error_model="numpy", inline="always")
def _cell(x):
    return math.floor(x / _CELL)
