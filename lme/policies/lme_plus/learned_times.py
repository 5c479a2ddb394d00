"""What the places that were in reach are known to cost, as in Real-Time Adaptive A*."""

from __future__ import annotations

import numpy as np

from lme.policies.lme_plus.kernels.learned_times import learn
from lme.policies.lme_plus.kernels.travel_grid import Grid
from lme.types import Floats

OTHER_TARGET = 1.0  # [m] by which the target may move before what was learned of the ways to it is forgotten
Learned = tuple[
    Floats, tuple[int, int]
]  # times (A, B) [s], and in them the row and column before a grid's first cell


class LearnedTimes:
    """The least time to the target from each cell that was ever in reach [s], in the carried frame; 0 where none was.

    A search says the time of the cells that it visited, and a least time of those that it had no reason to visit. Such
    times only rise, as in Learning Real-Time A* (Korf 1990), in the form of Real-Time Adaptive A* (Koenig and Likhachev
    2006, AAMAS, DOI 10.1145/1160633.1160682). Later, when a cell is at the edge of the disc and the points about it are
    not known, it still has its time. So a dead end that is longer than the reach of the memory is not entered again and
    again. The array grows in steps of the disc's width, so with the way.
    """

    def __init__(self) -> None:
        self._times = np.zeros((0, 0))
        self._first = 0, 0  # index of the first cell

    def around(self, grid: Grid) -> Learned:
        """The times, of which those about the cells of a grid may be changed."""
        wide = grid.size + 2
        low = round(grid.x / grid.cell) - 1, round(grid.y / grid.cell) - 1
        corner = low[0] - self._first[0], low[1] - self._first[1]
        rows, columns = self._times.shape
        if 0 <= corner[0] <= rows - wide and 0 <= corner[1] <= columns - wide:
            return self._times, corner
        if not self._times.size:
            self._first = low
        pads, first = [], []
        for at, start, count in zip(low, self._first, self._times.shape, strict=True):
            before, after = max(start - at, 0), max(at + wide - start - count, 0)
            pads.append((-(-before // wide) * wide, -(-after // wide) * wide))
            first.append(start - pads[-1][0])
        self._times, self._first = np.pad(self._times, pads), (first[0], first[1])
        return self._times, (low[0] - self._first[0], low[1] - self._first[1])

    def learn(
        self, times: Floats, grid: Grid, here: Floats, target: Floats, most: float, v_max: float
    ) -> None:
        """Take in the `times` (W, W) of a search of all ways from `here` to `target` (2,) of up to `most` [s]."""
        moves = 2.0 * OTHER_TARGET
        learn(*self.around(grid), times, (*grid,), here, target, most, v_max, moves)
