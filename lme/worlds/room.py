"""One map with a different start and goal for every number: the maps of the paper's §IV.A, and the user's own.

The map is read from a shape file, a plain bitmap with a size, or a ROS map_server map.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from lme.errors import argument_error, config_key, require
from lme.inputs.guarded_file import read_yaml
from lme.inputs.resources import resource_dir
from lme.types import Floats, Pose
from lme.worlds.bitmap import is_picture, read_bitmap, read_ros_map
from lme.worlds.rules import DrawnRules, check_chosen, check_numbers, map_path, path_measures
from lme.worlds.sampling import Configuration, FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.starts import STAGE_RADIUS
from lme.worlds.world import FloorPlan, Task

UNKNOWN = ("obstacle", "free")
DRAWING = "shapes.yaml"  # a shipped map is drawn in this file of its folder in maps/


@dataclass(slots=True)
class RoomConfig(DrawnRules):
    """Keys of `conf/map/_room.yaml`."""

    name: str | None
    path: str | None
    size: list[float] | None
    unknown: str

    def __post_init__(self) -> None:
        DrawnRules.__post_init__(self)  # super() fails in a dataclass with slots
        if self.unknown not in UNKNOWN:
            raise argument_error(f"unknown is {self.unknown!r}: must be {' or '.join(UNKNOWN)}")
        if self.size is not None:
            if len(self.size) != 2:
                raise argument_error(f"size is {list(self.size)}: must be [width, height] in metres, or null")
            for side in self.size:
                require("size", side, above=0.0)


class Room:
    """Configurations by number. Configuration n does not depend on which others are chosen."""

    Config: ClassVar[type[RoomConfig]] = RoomConfig

    def __init__(self, config: RoomConfig) -> None:
        """Read the map. Raises InputError for an invalid file, or one with too little free space."""
        path = _path(config)
        size = None if config.size is None else (config.size[0], config.size[1])
        source = (path, path.stat().st_mtime_ns, size, config.unknown)
        radius = STAGE_RADIUS if config.radius is None else config.radius
        self.config = config
        self.name = config.name or path.stem
        self._plan, self._space = _surveyed(*source, config.grid, radius, config.margin)
        self.numbers = config.numbers(self._available_numbers())
        self._configurations = {number: self._configuration(number) for number in self.numbers}

    def task(self, number: int) -> Task:
        """Build configuration `number`; its shortest path is computed once.

        Raises InputError for a number that was not chosen, and as `TaskRules.task` does.
        """
        check_chosen(number, self.numbers, "configuration", self.name)
        start, goal = self._configurations[number]
        straight = float(np.hypot(*(goal - np.array(start[:2]))))
        length = self._space.checked_length(f"map {self.name}, configuration {number}", start, goal)
        return self.config.task(
            self.name,
            number,
            self._plan.world,
            start,
            goal,
            length=length,
            speed=self.config.pace,
            measures=path_measures(length, straight),
        )

    def way(self, number: int) -> Floats:
        """(P, 2) points at which the shortest path of configuration `number` turns, both ends included [m].

        It is the one on the lattice: a disc of `config.radius` fits at its points. Raises InputError for a number
        that was not chosen.
        """
        check_chosen(number, self.numbers, "configuration", self.name)
        start, goal = self._configurations[number]
        return self._space.way(np.array(start[:2]), goal)

    def _available_numbers(self) -> range:
        return range(self.config.configurations)

    def _configuration(self, number: int) -> Configuration:
        return self._space.draw(self._rng(number), self.config.min_distance)

    def _rng(self, number: int) -> np.random.Generator:
        return np.random.default_rng([self.config.sample_seed, number])


def read_floor_plan(
    path: Path, size: tuple[float, float] | None = None, unknown: str = "obstacle"
) -> FloorPlan:
    """Read any map file: a .yaml with `image` is a ROS map, another .yaml a shape file, the rest are pictures.

    size: (width, height) [m] of a picture. unknown: "obstacle" or "free", unknown cells of a ROS map.
    Raises InputError for a picture without a size, for anything else with one, and whatever the readers raise.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        if not is_picture(path):
            raise argument_error(
                f"path is {path}: is not a picture; must be a shape file (.yaml), a ROS map (.yaml) or a picture"
            )
        if size is None:
            raise argument_error(f"size is null: must be [width, height] in metres for the picture {path}")
        return read_bitmap(path, size)
    if size is not None:
        raise argument_error(f"size is {list(size)}: must be null, as {path} gives its own size")
    drawing = read_yaml(path)
    if isinstance(drawing, dict) and "image" in drawing:
        return read_ros_map(path, unknown_is_obstacle=unknown == "obstacle")
    return floor_plan(str(path), drawing)


@lru_cache(maxsize=4)
def _surveyed(
    path: Path,
    _modified: int,  # part of the key, so that an edited file is read again
    size: tuple[float, float] | None,
    unknown: str,
    grid: float,
    radius: float,
    margin: float,
) -> tuple[FloorPlan, FreeSpace]:
    """The map and its free space, computed once per process."""
    plan = read_floor_plan(path, size, unknown)
    return plan, FreeSpace(plan, grid, radius, margin)


def _path(config: RoomConfig) -> Path:
    if config.path is not None:
        return map_path(config.path, "a shape file, ROS map or picture")
    shipped = sorted(drawing.parent.name for drawing in resource_dir("maps").glob(f"*/{DRAWING}"))
    if config.name is None:
        raise argument_error("path is null: must be a shape file (.yaml), a ROS map (.yaml) or a picture")
    if config.name not in shipped:
        raise argument_error(f"name is {config.name!r}: must be one of {', '.join(shipped)}, or give path")
    return resource_dir("maps") / config.name / DRAWING


@dataclass(slots=True)
class MapFileConfig(RoomConfig):
    """Keys of `conf/map/file.yaml`."""

    start: list[float] | None
    goal: list[float] | None

    def __post_init__(self) -> None:
        RoomConfig.__post_init__(self)  # super() fails in a dataclass with slots
        if self.start is not None:
            right = "[x, y] or [x, y, yaw] in metres and radians, or null"
            check_numbers("start", self.start, (2, 3), right)
        if self.goal is not None:
            check_numbers("goal", self.goal, (2,), "[x, y] in metres, or null")
        if self.start is not None and self.goal is not None:
            _check_single(self.worlds, "start and goal")


class MapFile(Room):
    """A room whose start, goal or both are given; the rest is drawn for each number, as in a room.

    The config gives them, or else the file. With both given there is one configuration, number 0. A start without a
    yaw faces the goal.
    """

    Config = MapFileConfig
    config: MapFileConfig

    def _start(self) -> Sequence[float] | None:
        return self._plan.start if self.config.start is None else self.config.start

    def _goal(self) -> Sequence[float] | None:
        return self._plan.goal if self.config.goal is None else self.config.goal

    def _available_numbers(self) -> range:
        if self._start() is None or self._goal() is None:
            return super()._available_numbers()
        _check_single(self.config.worlds, "the start and the goal of the file")
        return range(1)

    def _configuration(self, number: int) -> Configuration:
        start, goal = self._start(), self._goal()
        for key, point in (("start", start), ("goal", goal)):
            if point is not None:
                self._space.check_free(config_key(key), point)
        if start is not None:
            return self._from_given_start(start, number)
        if goal is not None:
            return self._to_given_goal(np.array(goal), number)
        return super()._configuration(number)

    def _from_given_start(self, start: Sequence[float], number: int) -> Configuration:
        """Configuration from the given start to the given goal, or to a drawn one."""
        position, given_goal = np.array(start[:2]), self._goal()
        if given_goal is None:
            goal = self._space.draw_partner(self._rng(number), position, self.config.min_distance)
        else:
            goal = np.array(given_goal)
        yaw = start[2] if len(start) == 3 else math.atan2(goal[1] - position[1], goal[0] - position[0])
        return Configuration(Pose(start[0], start[1], yaw), goal)

    def _to_given_goal(self, goal: Floats, number: int) -> Configuration:
        """Configuration from a drawn start, with any yaw, to the given goal."""
        rng = self._rng(number)
        x, y = self._space.draw_partner(rng, goal, self.config.min_distance).tolist()
        return Configuration(Pose(x, y, rng.uniform(-math.pi, math.pi)), goal)


def _check_single(worlds: list[int] | None, keys: str) -> None:
    """Raise InputError if worlds other than the only one that `keys` leaves, number 0, are chosen."""
    if worlds not in (None, [0]):
        raise argument_error(
            f"worlds is {worlds}: must be null or [0], since {keys} together leave one configuration"
        )
