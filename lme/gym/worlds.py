"""The worlds in which the robots of a fleet drive, each stored once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lme.grids.leaves import Leaves, leaves_of
from lme.gym.kernels.steps import Obstacles, Places
from lme.types import Ints
from lme.worlds.world import Task, World

MOST_TASKS = 4096  # that are kept, since episodes return to their worlds


class WorldStore:
    """Obstacles of all worlds and the rules of all tasks, in shared arrays that the kernels read.

    A robot refers to its task by the number of a row. Tasks that share a world share its obstacles.
    """

    def __init__(self) -> None:
        self.tasks: list[Task] = []
        self.worlds: list[World] = []
        self._rows: dict[int, int] = {}  # by the identity of a task, which `tasks` keeps alive
        self._spans: dict[int, tuple[int, ...]] = {}  # by the identity of a world
        self._discs, self._walls = _LeafPool(3), _LeafPool(4)
        self._places = places(0)
        self._world_numbers = np.empty(0, np.int64)
        self.optimal_times, self.numbers = np.empty(0), np.empty(0, np.int64)

    @property
    def obstacles(self) -> Obstacles:
        """The obstacles of all worlds."""
        return Obstacles(*self._discs.leaves, *self._walls.leaves)

    def rows(self, tasks: Sequence[Task]) -> Ints:
        """Rows of tasks, which are stored if they are new."""
        fresh = [task for task in {id(task): task for task in tasks}.values() if id(task) not in self._rows]
        for task in fresh:
            self._rows[id(task)] = len(self.tasks)
            self.tasks.append(task)
        if fresh:
            self._extend(fresh)
        return np.array([self._rows[id(task)] for task in tasks], np.int64)

    def places(self, rows: Ints) -> Places:
        """The tasks in these rows."""
        return Places._make(array[rows] for array in self._places)

    def by_lattice(self, rows: Ints) -> list[tuple[World, Ints]]:
        """Worlds whose edges the lidar meets by their lattice, and which of the rows are in each."""
        if not self._places.spans[:, 4].any():
            return []
        numbers = np.where(self._places.spans[rows, 4] > 0, self._world_numbers[rows], -1)
        return [(self.worlds[n], np.flatnonzero(numbers == n)) for n in np.unique(numbers) if n >= 0]

    def _extend(self, tasks: Sequence[Task]) -> None:
        spans = [self._span(task) for task in tasks]
        added = Places(
            np.array([span[:5] for span in spans], np.int64),
            np.array([task.start[:2] for task in tasks], np.float64),
            np.array([task.goal for task in tasks], np.float64),
            np.array([(task.goal_tolerance, task.time_limit, task.clock_distance) for task in tasks]),
        )
        self._places = Places._make(np.concatenate(pair) for pair in zip(self._places, added, strict=True))
        self._world_numbers = np.append(self._world_numbers, [span[5] for span in spans])
        self.optimal_times = np.append(self.optimal_times, [task.optimal_time for task in tasks])
        self.numbers = np.append(self.numbers, [task.number for task in tasks])

    def _span(self, task: Task) -> tuple[int, ...]:
        """Row of `Places.spans` and the number of the world, which is stored if it is new."""
        world = task.world
        if id(world) not in self._spans:
            has_lattice = len(world.lattice.edges) > 0
            spans = *self._discs.add(world.discs), *self._walls.add(world.walls)
            self._spans[id(world)] = (*spans, int(has_lattice), len(self.worlds))
            self.worlds.append(world)
        return self._spans[id(world)]


class _LeafPool:
    """Leaves of many worlds in one array, which doubles when it is full."""

    def __init__(self, width: int) -> None:
        self.leaves = leaves_of(np.empty((0, width)))
        self._count = 0

    def add(self, leaves: Leaves) -> tuple[int, int]:
        """Store leaves; return the number of the first and of the last + 1."""
        first, stop = self._count, self._count + leaves.shapes.shape[0]
        bounds, shapes = self.leaves
        if stop > len(shapes):
            missing = max(stop, 2 * len(shapes)) - len(shapes)
            bounds = np.concatenate([bounds, np.zeros((3, missing))], axis=1)
            shapes = np.concatenate([shapes, np.zeros((missing, *shapes.shape[1:]))])
            self.leaves = Leaves(bounds, shapes)
        bounds[:, first:stop], shapes[first:stop] = leaves
        self._count = stop
        return first, stop


def places(count: int) -> Places:
    """Return room for tasks of so many robots."""
    return Places(
        np.zeros((count, 5), np.int64), np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 3))
    )
