"""One map with a different start and goal for every number: the maps of the paper's §IV.A.

The map is read from a shape file, a plain bitmap with a size, or a ROS map_server map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from lme.errors import InputError, require
from lme.inputs.guarded_file import read_yaml
from lme.inputs.resources import resource_dir
from lme.types import Floats
from lme.worlds.bitmap import is_picture, read_bitmap, read_ros_map
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.rules import DrawnRules, check_chosen, map_path, path_measures
from lme.worlds.sampling import Configuration, FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.starts import STAGE_RADIUS
from lme.worlds.world import Task

UNKNOWN = ("obstacle", "free")
DRAWING = "shapes.yaml"  # a shipped map is drawn in this file of its folder in maps/


@dataclass(slots=True)
class RoomConfig(DrawnRules):
    """Keys of `conf/map/_room.yaml`."""

    name: str | None = None  # in the records; None: the file's name
    path: str | None = None  # shape file, ROS map or picture; None: the shape file that ships under `name`
    size: list[float] | None = None  # width, height [m] of a plain picture
    unknown: str = "obstacle"  # obstacle | free: unknown cells of a ROS map

    def __post_init__(self) -> None:
        DrawnRules.__post_init__(self)  # super() fails in a dataclass with slots
        if self.unknown not in UNKNOWN:
            raise InputError(f"map.unknown is {self.unknown!r}: must be {' or '.join(UNKNOWN)}")
        self._check_size()

    def _check_size(self) -> None:
        if self.size is not None:
            if len(self.size) != 2:
                raise InputError(f"map.size is {list(self.size)}: must be [width, height] in metres, or null")
            for side in self.size:
                require("map.size", side, above=0.0)


class Room:
    """Configurations by number. Configuration n does not depend on which others are chosen."""

    Config = RoomConfig

    def __init__(self, config: RoomConfig) -> None:
        """Read the map. Raises InputError for an invalid file, or one with too little free space."""
        path = _path(config)
        size = None if config.size is None else (config.size[0], config.size[1])
        source = (path, path.stat().st_mtime_ns, size, config.unknown)
        radius = STAGE_RADIUS if config.radius is None else config.radius
        self.config = config
        self._name = config.name or path.stem
        self._plan, self._space = _surveyed(*source, config.grid, radius, config.margin)
        self._configurations = {
            number: self._configuration(number) for number in config.numbers(self._available_numbers())
        }

    @property
    def name(self) -> str:
        """Name of this map in the records."""
        return self._name

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the chosen configurations."""
        return tuple(self._configurations)

    def task(self, number: int) -> Task:
        """Build configuration `number`; its shortest path is computed once.

        Raises InputError for a number that was not chosen, and as `TaskRules.task` does.
        """
        check_chosen(number, self.numbers, "configuration", self._name)
        start, goal = self._configurations[number]
        straight = float(np.hypot(*(goal - np.array(start[:2]))))
        length = self._space.checked_length(f"map {self._name}, configuration {number}", start, goal)
        return self.config.task(
            self._name,
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
        check_chosen(number, self.numbers, "configuration", self._name)
        start, goal = self._configurations[number]
        return self._space.way(np.array(start[:2]), goal)

    def _available_numbers(self) -> range:
        return range(self.config.configurations)

    def _configuration(self, number: int) -> Configuration:
        return self._space.draw(self._rng(number), self.config.min_distance)

    def _rng(self, number: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence([self.config.sample_seed, number]))


def read_floor_plan(
    path: Path, size: tuple[float, float] | None = None, unknown: str = "obstacle"
) -> FloorPlan:
    """Read any map file: a .yaml with `image` is a ROS map, another .yaml a shape file, the rest are pictures.

    size: (width, height) [m] of a picture. unknown: "obstacle" or "free", unknown cells of a ROS map.
    Raises InputError for a picture without a size, for anything else with one, and whatever the readers raise.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        if not is_picture(path):
            raise InputError(
                f"map.path is {path}: is not a picture; must be a shape file (.yaml), a ROS map (.yaml) or a picture"
            )
        if size is None:
            raise InputError(f"map.size is null: must be [width, height] in metres for the picture {path}")
        return read_bitmap(path, size)
    if size is not None:
        raise InputError(f"map.size is {list(size)}: must be null, as {path} gives its own size")
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
        raise InputError("map.path is null: must be a shape file (.yaml), a ROS map (.yaml) or a picture")
    if config.name not in shipped:
        raise InputError(
            f"map.name is {config.name!r}: must be one of {', '.join(shipped)}, or give map.path"
        )
    return resource_dir("maps") / config.name / DRAWING
