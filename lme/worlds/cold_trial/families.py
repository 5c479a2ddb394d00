"""The families of worlds of the cold trial: from random numbers and a robot to a task that the robot can drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lme.worlds.barn import Barn
from lme.worlds.barn.map_set import FIRST_FRESH, BarnConfig
from lme.worlds.building import Buildings, BuildingsConfig
from lme.worlds.dynabarn import DIFFICULTIES, Dynabarn, DynabarnConfig
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.indoor import Indoor, IndoorConfig
from lme.worlds.indoor.map_set import KINDS
from lme.worlds.sampling import FreeSpace
from lme.worlds.traps import Traps, TrapsConfig
from lme.worlds.world import Task

BUILDINGS, STAND_IN = "buildings", "floor_plans"  # real maps; generated ones, where none are given
STATIC, DYNABARN = "static", "dynabarn"

_GRID_M = 0.05  # between the points at which a BARN world's passages are checked
_APART_M = 8.0  # least distance from start to goal in a building, as in conf/map/building.yaml
# Around a BARN world: the walls of its start area, its grid, and the open space at the goal
_BARN_OUTLINE = np.array([[-4.5, 0.0], [0.0, 0.0], [0.0, 14.0], [-4.5, 14.0]])


class Place(NamedTuple):
    """What decides a world besides the family.

    seed: of the world. choice: of a kind or a building. radius: [m] of the disc that must have a path. margin: [m] by
    which start and goal have more free space around them. paths: ROS maps of buildings.
    """

    seed: int
    choice: int
    radius: float
    margin: float
    paths: tuple[str, ...]


def _barn(place: Place) -> Task:
    """A fresh world; its passages have the width that they have, so a footprint may not fit: then InputError."""
    number = FIRST_FRESH + place.choice
    task = Barn(BarnConfig(subset="fresh", fresh_seed=place.seed, worlds=[number])).task(number)
    space = FreeSpace(FloorPlan(task.world, _BARN_OUTLINE), _GRID_M, place.radius, place.margin)
    length = space.checked_length(f"map barn, world {number}", task.start, task.goal)
    return replace(task, shortest_path_length=length)


def _indoor(place: Place) -> Task:
    """A generated building of any kind."""
    kind = list(KINDS)[place.choice % len(KINDS)]
    config = IndoorConfig(kind=kind, building_seed=place.seed, radius=place.radius, margin=place.margin)
    return Indoor(config).task(0)


def _floor_plan(place: Place) -> Task:
    """A generated floor plan, with start and goal as far apart as in a real building."""
    config = IndoorConfig(
        kind="floor_plan",
        building_seed=place.seed,
        min_distance=_APART_M,
        radius=place.radius,
        margin=place.margin,
    )
    return Indoor(config).task(0)


def _building(place: Place) -> Task:
    """One of the real buildings, with a start and a goal of its own."""
    config = BuildingsConfig(
        paths=list(place.paths),
        configurations=1,
        sample_seed=place.seed,
        min_distance=_APART_M,
        radius=place.radius,
        margin=place.margin,
    )
    maps = Buildings(config)
    return maps.task(place.choice % len(maps.numbers))


def _traps(place: Place) -> Task:
    """A random trap."""
    return Traps(TrapsConfig(kind="mixed", starts=1, start_seed=place.seed, radius=place.radius)).task(0)


def _dynabarn(place: Place) -> Task:
    """Moving cylinders, at any difficulty; the arena is wide enough for all footprints."""
    difficulty = list(DIFFICULTIES)[place.choice % len(DIFFICULTIES)]
    return Dynabarn(DynabarnConfig(difficulty=difficulty, motion_seed=place.seed)).task(0)


_MAKERS: dict[str, Callable[[Place], Task]] = {
    "barn": _barn,
    "indoor": _indoor,
    BUILDINGS: _building,
    STAND_IN: _floor_plan,
    "traps": _traps,
    DYNABARN: _dynabarn,
}


def families(subset: str, paths: Sequence[str] | None) -> tuple[str, ...]:
    """The names of the subset's families. Generated floor plans stand for buildings if there are no maps."""
    if subset == DYNABARN:
        return (DYNABARN,)
    return ("barn", "indoor", BUILDINGS if paths else STAND_IN, "traps")


def task_in(family: str, place: Place) -> Task:
    """The task of a family. Raises InputError if the world has no path for a disc of the place's radius."""
    return _MAKERS[family](place)


def check_paths(paths: Sequence[str]) -> None:
    """Raise InputError for a path of a building that does not exist."""
    Buildings(BuildingsConfig(paths=list(paths), configurations=1))
