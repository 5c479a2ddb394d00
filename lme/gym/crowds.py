"""The movers of the worlds that many robots drive in."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lme.gym.kernels.crowds import Crowds, Walkers
from lme.simulation.crowd import top_speed
from lme.simulation.crowd_step import CrowdState, Paths, Pedestrians, paths_of, people_of, state_at_start
from lme.types import Ints
from lme.worlds.world import World

MOST_PEOPLE = 16  # in an observation
MOST_WORLDS = 1024  # that are kept, since episodes return to their worlds


class _Stored(NamedTuple):
    """Movers of one world, with their state at the start of an episode and their greatest speed [m/s]."""

    world: World  # is kept alive, since its identity is a key
    paths: Paths
    people: Pedestrians | None
    start: CrowdState
    top_speed: float


class CrowdStore:
    """Movers around N robots: the paths of each world are stored once, and each robot has its own state of them."""

    def __init__(self, n: int) -> None:
        self._stored: list[_Stored] = []
        self._numbers: dict[int, int] = {}  # by the identity of a world
        self._worlds = np.full(n, -1, np.int64)
        empty = state_at_start((), paths_of(()), None)
        self._states = CrowdState._make(np.zeros((n, *array.shape), array.dtype) for array in empty)
        self._packed: tuple[Crowds, Walkers | None] | None = None

    def begin(self, i: int, world: World) -> float:
        """Put the movers around robot i at the start of their paths; return their greatest speed [m/s]."""
        stored = self._of(world)
        self._worlds[i] = self._numbers[id(world)]
        widths = [array.shape[1] for array in self._states]
        if any(len(values) > width for values, width in zip(stored.start, widths, strict=True)):
            self._states = CrowdState._make(map(_wide_enough, self._states, stored.start))
            self._packed = None
        for array, values in zip(self._states, stored.start, strict=True):
            array[i, : len(values)] = values
        return stored.top_speed

    def packed(self) -> tuple[Crowds, Walkers | None]:
        """The movers, as the kernels take them; no walkers where nobody walks."""
        if self._packed is None:
            paths, rows = _joined([stored.paths for stored in self._stored])
            crowds = Crowds(self._worlds, self._states, Paths(*paths), rows)
            walkers = None
            if any(stored.people is not None for stored in self._stored):
                people, rows = _joined([stored.people or _NOBODY for stored in self._stored])
                walkers = Walkers(Pedestrians(*people), rows)
            self._packed = crowds, walkers
        return self._packed

    def _of(self, world: World) -> _Stored:
        if id(world) not in self._numbers:
            if len(self._stored) >= MOST_WORLDS + len(self._worlds):
                self._forget()
            paths, people = paths_of(world.movers), people_of(world.movers, world)
            start = state_at_start(world.movers, paths, people)
            self._numbers[id(world)] = len(self._stored)
            self._stored.append(_Stored(world, paths, people, start, top_speed(world.movers)))
            self._packed = None
        return self._stored[self._numbers[id(world)]]

    def _forget(self) -> None:
        """Forget the worlds that no robot is in."""
        is_used = self._worlds >= 0
        used, self._worlds[is_used] = np.unique(self._worlds[is_used], return_inverse=True)
        self._stored = [self._stored[k] for k in used.tolist()]
        self._numbers = {id(stored.world): k for k, stored in enumerate(self._stored)}


_NOBODY = Pedestrians(
    movers=np.empty(0, np.int64),
    is_orca=np.empty(0, np.bool_),
    traits=np.empty((0, 5)),
    legs=np.empty((0, 2), np.int64),
    waypoints=np.empty((0, 2)),
    repeats=np.empty(0, np.int64),
    others=np.empty(0, np.int64),
    radii=np.empty(0),
    circles=np.empty((0, 3)),
    edges=np.empty((0, 4)),
)


def _wide_enough(array: np.ndarray[Any, Any], values: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return the array (N, ...) with room for the values in every row."""
    missing = len(values) - array.shape[1]
    return array if missing <= 0 else np.pad(array, [(0, 0), (0, missing), *[(0, 0)] * (array.ndim - 2)])


def _joined(tuples: list[Any]) -> tuple[list[np.ndarray[Any, Any]], Ints]:
    """Join the arrays of K named tuples; return them with the rows of each: (K, F, 2), first and last + 1."""
    columns = list(zip(*tuples, strict=True))
    ends = np.cumsum([[len(array) for array in column] for column in columns], axis=1).T
    starts = np.vstack([np.zeros_like(ends[:1]), ends[:-1]])
    return [np.concatenate(column) for column in columns], np.stack([starts, ends], axis=2)
