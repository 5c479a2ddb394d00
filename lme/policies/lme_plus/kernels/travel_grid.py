"""What the search for expected times works on: a grid, the robot's pace in it, and arrays that are used again."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.policies.lme_plus.kernels.nearest_points import pad
from lme.types import Bools, Floats

HALF_DIAGONAL = math.sqrt(0.5)  # of a cell; no place in it is farther from its centre


class Grid(NamedTuple):
    """`size` × `size` square cells of side `cell` [m], of which those of the largest disc inside the frame are used.

    x, y: the corner with the lowest coordinates [m].
    """

    x: float
    y: float
    cell: float
    size: int


GridNumbers = tuple[float, float, float, int]  # a Grid as a plain tuple
PaceNumbers = tuple[float, float, float, float, float, float, float]  # a Pace as a plain tuple


class Pace(NamedTuple):
    """The robot's expected speed at a place, by the distance d of the nearest obstacle point [m].

    d ≥ comfort: v_max [m/s]. From there down to d = inner the time per metre grows with the square of the difference,
    up to (1 + slowdown) times, and from there down to d = tight with the difference, up to `narrow` times. d < tight:
    no passage. Between points on two sides, d is half of the distance between these (`passages.half_width`). Within
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
    """Arrays that `travel_times` uses again, so that a call costs only as much as it visits. W = size + 2, C = W².

    times (W, W): the result [s]. tentative (C,): the least times so far [s]; −inf where no way leads, so outside the
    disc. edge (E,): the cells of the disc with a neighbour outside it. steps (C,): time across a cell [s], 0 if not
    known yet. narrow (C,): whether a cell is in a narrow passage, between points on two sides, if its step is known.
    away (C,): distance from the robot [cells], likewise. squares, first, marks: see `nearest_points.draw`. nodes
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
    wide, padded, disc = size + 2, size + 2 * pad(comfort, cell), _disc(size)
    return Workspace(
        times=np.full((wide, wide), np.inf),
        tentative=np.where(disc, np.inf, -np.inf).ravel(),
        steps=np.zeros(wide * wide),
        narrow=np.zeros(wide * wide, np.bool_),
        away=np.empty(wide * wide),
        squares=np.full((padded, padded), np.inf),
        first=np.full((size, size), -1, np.int32),
        marks=np.empty(padded * padded, np.int32),
        nodes=np.empty((2, 5 * wide * wide), np.int32),
        walls=np.empty(wide * wide, np.int32),
        used=np.zeros(2, np.int64),
        edge=np.flatnonzero(_edge(disc)).astype(np.int32),
    )


def _disc(size: int) -> Bools:
    """Whether each of (size + 2, size + 2) cells is in the disc."""
    along = np.arange(size + 2) - (size + 1) / 2
    inside: Bools = np.hypot(along[:, None], along) <= disc_radius(size)
    return inside


def _edge(disc: Bools) -> Bools:
    """Which cells of the disc have one of their four neighbours outside it."""
    inner = np.zeros_like(disc)
    inner[1:-1, 1:-1] = disc[:-2, 1:-1] & disc[2:, 1:-1] & disc[1:-1, :-2] & disc[1:-1, 2:]
    return disc & ~inner


@njit(cache=True, error_model="numpy", inline="always")
def disc_radius(size: int) -> float:
    """Radius of the disc [cells]; one cell less than would fit, so that what is known reaches beyond its edge."""
    return 0.5 * size - 1.0
