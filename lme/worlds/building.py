"""Maps of real buildings, such as `lme maps build` makes: several maps, each with starts and goals as in a room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numba import njit
from scipy import ndimage

from lme.errors import argument_error
from lme.geometry.heap import pop, push
from lme.inputs.guarded_file import expanded
from lme.types import Floats
from lme.worlds.room import Room, RoomConfig
from lme.worlds.rules import DrawnRules, check_chosen
from lme.worlds.sampling import FreeSpace
from lme.worlds.world import Task

_SHARED = [key.name for key in fields(DrawnRules) if key.name != "worlds"]  # keys of each building's room


@dataclass(slots=True)
class BuildingsConfig(DrawnRules):
    """Keys of `conf/map/building.yaml`."""

    paths: list[str] | None
    name: str | None


class Buildings:
    """Configurations by number: number b × configurations + k is configuration k of building b.

    Buildings are in the order of `paths`, those of a folder in the order of their names. A building is read once one of
    its numbers is needed.
    """

    Config = BuildingsConfig

    def __init__(self, config: BuildingsConfig) -> None:
        """Find the buildings.

        Raises InputError if there are no paths or one does not exist, and for a number that no building has.
        """
        self.config = config
        self._paths = _maps(config.paths)
        single = self._paths[0].stem if len(self._paths) == 1 else "building"
        self.name = config.name or single
        self.numbers = config.numbers(range(len(self._paths) * config.configurations))
        last_number = len(self._paths) * config.configurations - 1
        if max(self.numbers) > last_number:
            raise argument_error(
                f"worlds holds {max(self.numbers)}: must be at most {last_number}, for {len(self._paths)} "
                f"buildings with {config.configurations} configurations each (configurations)"
            )
        self._rooms: dict[int, _MeasuredRoom] = {}

    def task(self, number: int) -> Task:
        """Build configuration `number`; its shortest path is computed once.

        Raises InputError for a number that was not chosen, and as `Room` does for the building's map.
        """
        check_chosen(number, self.numbers, "configuration", self.name)
        building, configuration = divmod(number, self.config.configurations)
        task = self._room(building).task(configuration)
        measures = {"building": float(building), **task.measures}
        return replace(task, map_name=self.name, number=number, measures=measures)

    def way(self, number: int) -> Floats:
        """Return the turns of the shortest path of configuration `number`, as `Room.way` does."""
        check_chosen(number, self.numbers, "configuration", self.name)
        building, configuration = divmod(number, self.config.configurations)
        return self._room(building).way(configuration)

    def _room(self, building: int) -> _MeasuredRoom:
        if building not in self._rooms:
            count = self.config.configurations
            worlds = [number % count for number in self.numbers if number // count == building]
            shared = {key: getattr(self.config, key) for key in _SHARED}
            self._rooms[building] = _MeasuredRoom(
                RoomConfig(
                    name=None,
                    path=str(self._paths[building]),
                    size=None,
                    unknown="obstacle",
                    worlds=worlds,
                    **shared,
                )
            )
        return self._rooms[building]


class _MeasuredRoom(Room):
    """A room whose tasks also measure the width of the way."""

    def task(self, number: int) -> Task:
        task = super().task(number)
        low = self._plan.outline.min(axis=0)
        start, goal = (_cell(np.array(point[:2]), low, self.config.grid) for point in (task.start, task.goal))
        passage = _passage(self._space, self.config.grid, start, goal)
        return replace(task, measures={**task.measures, "passage_m": passage})


def _maps(paths: Sequence[str] | None) -> list[Path]:
    """Return the map files, with a folder replaced by those in it. Raises InputError for a path that is not right."""
    if not paths:
        raise argument_error(
            f"paths is {'null' if paths is None else '[]'}: must be a list of ROS maps (.yaml) or folders of them, "
            "e.g. [office.yaml]; lme maps build makes one from a log"
        )
    files: list[Path] = []
    for path in paths:
        folder = expanded(path)
        inside = sorted(folder.glob("*.yaml")) if folder.is_dir() else []
        if folder.is_dir() and not inside:
            raise argument_error(f"paths holds {path}: the folder has no maps (.yaml)")
        if not inside and not folder.is_file():
            raise argument_error(
                f"paths holds {path}: no such file; must be a ROS map (.yaml) or a folder of them"
            )
        files += inside or [folder]
    return files


def _cell(point: Floats, low: Floats, step: float) -> tuple[int, int]:
    """Row and column of the lattice point nearest to a point (2,) [m]."""
    column, row = np.floor((point - low) / step).astype(int).tolist()
    return row, column


@lru_cache(maxsize=4096)
def _passage(space: FreeSpace, step: float, start: tuple[int, int], goal: tuple[int, int]) -> float:
    """Width of the narrowest place on the widest way from start to goal, both included, to about `step` [m]."""
    return 2.0 * float(_widest_path(_clearance(space, step), start, goal))


@lru_cache(maxsize=4)
def _clearance(space: FreeSpace, step: float) -> Floats:
    """(Y, X) distance of each lattice point to the nearest obstacle [m], without the limit of `space.clearance`.

    Beyond that limit, it is the distance of the nearest point within the limit plus the distance to that point, which
    is a little too much.
    """
    limited = space.clearance
    limit = limited.max()
    cells_away, (rows, columns) = ndimage.distance_transform_edt(limited >= limit, return_indices=True)
    return np.where(limited < limit, limited, np.maximum(limited[rows, columns] + cells_away * step, limit))


@njit(cache=True, error_model="numpy")
def _widest_path(clearance: Floats, start: tuple[int, int], goal: tuple[int, int]) -> float:
    """Return the greatest clearance that a way between two lattice points can keep everywhere; 0 if there is no way.

    Ways go in eight directions. Of the points next to those reached before, the one with the greatest clearance is
    taken next, as in Prim's algorithm.
    """
    # A heap of the points next to those taken, by −clearance, so that the widest comes first.
    rows, columns = clearance.shape
    keys, items = np.empty(clearance.size), np.empty(clearance.size, np.int64)
    is_queued = np.zeros(clearance.shape, np.bool_)
    is_queued[start] = True
    size = push(keys, items, 0, -clearance[start], start[0] * columns + start[1])
    width = np.inf
    while size > 0:
        # The least clearance of the points taken so far is the greatest that a way to this one can keep.
        width = min(width, -keys[0])
        row, column = items[0] // columns, items[0] % columns
        if row == goal[0] and column == goal[1]:
            return float(width)
        size = pop(keys, items, size)
        # Put its neighbours that are new on the heap.
        for down in range(-1, 2):
            for right in range(-1, 2):
                r, c = row + down, column + right
                if 0 <= r < rows and 0 <= c < columns and not is_queued[r, c]:
                    is_queued[r, c] = True
                    size = push(keys, items, size, -clearance[r, c], r * columns + c)
    return 0.0
