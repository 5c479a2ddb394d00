"""One drawn place, many configurations: the maps that LME trains on and is tried on (paper §IV.A).

Sources: a shape file, a plain bitmap with a size, a ROS map_server map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from lme.errors import InputError, require
from lme.resources import resource_dir
from lme.worlds.bitmap import read_bitmap, read_ros_map
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.sampling import Configuration, FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.starts import STAGE_RADIUS, check_worlds
from lme.worlds.world import Task
from lme.worlds.yaml_entry import read_yaml

UNKNOWN = ("obstacle", "free")
DRAWING = "shapes.yaml"  # of a map that ships with the package, in its folder of maps/


@dataclass(slots=True)
class RoomConfig:
    """Keys of `conf/map/{env1,env2,file}.yaml`."""

    name: str | None = None  # in the records; None: the file's name
    path: str | None = None  # shape file, ROS map, picture; None: the drawing that ships under `name`
    size: list[float] | None = None  # width, height [m] of a plain picture
    unknown: str = "obstacle"  # obstacle | free: unknown cells of a ROS map
    configurations: int = 50  # pairs of start and goal, numbers 0, 1, …
    worlds: list[int] | None = None  # these numbers instead
    sample_seed: int = 0  # which stream of configurations
    min_distance: float = 3.0  # [m] from start to goal, in a straight line
    radius: float | None = None  # [m] of the disc that must be able to reach the goal; None: STAGE_RADIUS
    margin: float = 0.1  # [m] more than radius, kept free around start and goal
    grid: float = 0.05  # [m] between the points that are tried
    goal_tolerance: float = 0.2  # [m]
    time_limit: float = 40.0  # [s]
    clock_distance: float = 0.0  # [m]
    speed: float = 0.5  # [m/s] of the optimal time

    def __post_init__(self) -> None:
        if self.unknown not in UNKNOWN:
            raise InputError(f"map.unknown is {self.unknown!r}: must be {' or '.join(UNKNOWN)}")
        require("map.configurations", self.configurations, at_least=1)
        require("map.sample_seed", self.sample_seed, at_least=0)
        for key in ("min_distance", "margin", "clock_distance"):
            require(f"map.{key}", getattr(self, key), at_least=0.0)
        if self.radius is not None:
            require("map.radius", self.radius, above=0.0)
        for key in ("grid", "goal_tolerance", "time_limit", "speed"):
            require(f"map.{key}", getattr(self, key), above=0.0)
        self._check_size()
        check_worlds(self.worlds)

    def _check_size(self) -> None:
        if self.size is not None:
            if len(self.size) != 2:
                raise InputError(f"map.size is {list(self.size)}: must be [width, height] in metres, or null")
            for side in self.size:
                require("map.size", side, above=0.0)


class Room:
    """Configurations under their numbers. Number n is the same whatever others are chosen."""

    Config = RoomConfig

    def __init__(self, config: RoomConfig) -> None:
        """Raises InputError for a file that is not right, or with too little free space."""
        self.config = config
        path = _path(config)
        self._name = config.name or path.stem
        self._numbers = tuple(range(config.configurations) if config.worlds is None else config.worlds)
        source = (path, path.stat().st_mtime_ns, _size(config), config.unknown)
        radius = STAGE_RADIUS if config.radius is None else config.radius
        self._plan, self._space = _surveyed(*source, config.grid, radius, config.margin)
        self._configurations = {number: self._drawn(number) for number in self._numbers}
        self._lengths: dict[int, float] = {}

    @property
    def numbers(self) -> tuple[int, ...]:
        """The configurations chosen, by their own numbers."""
        return self._numbers

    def task(self, number: int) -> Task:
        """Configuration `number`; its shortest path is computed once."""
        if number not in self._configurations:
            raise InputError(f"configuration {number} is not among the chosen ones of map {self._name}")
        config, (start, goal) = self.config, self._configurations[number]
        straight = float(np.hypot(*(goal - np.array(start[:2]))))
        length = self._length(number)
        return Task(
            map_name=self._name,
            number=number,
            world=self._plan.world,
            start=start,
            goal=goal,
            goal_tolerance=config.goal_tolerance,
            time_limit=config.time_limit,
            clock_distance=config.clock_distance,
            shortest_path_length=length,
            optimal_time=length / config.speed,
            measures={"straight_m": straight, "detour": length / straight},
        )

    def _drawn(self, number: int) -> Configuration:
        rng = np.random.default_rng(np.random.SeedSequence([self.config.sample_seed, number]))
        return self._space.draw(rng, self.config.min_distance)

    def _length(self, number: int) -> float:
        if number not in self._lengths:
            self._lengths[number] = self._space.path_length(*self._configurations[number])
        return self._lengths[number]


def read_floor_plan(
    path: Path, size: tuple[float, float] | None = None, unknown: str = "obstacle"
) -> FloorPlan:
    """Read any map file: .yaml with `image` is a ROS map, other .yaml a shape file, the rest are pictures.

    Raises InputError for a picture without a size, for anything else with one, and as the readers do.
    """
    if path.suffix.lower() not in (".yaml", ".yml"):
        if size is None:
            raise InputError(f"map.size is null: must be [width, height] in metres for the picture {path}")
        return read_bitmap(path, size)
    if size is not None:
        raise InputError(f"map.size is {list(size)}: must be null, for {path} says itself how large it is")
    drawing = read_yaml(path)
    if isinstance(drawing, dict) and "image" in drawing:
        return read_ros_map(path, unknown_is_obstacle=unknown == "obstacle")
    return floor_plan(str(path), drawing)


@lru_cache(maxsize=4)
def _surveyed(
    path: Path,
    _modified: int,  # part of the key: a file that was edited is read again
    size: tuple[float, float] | None,
    unknown: str,
    grid: float,
    radius: float,
    margin: float,
) -> tuple[FloorPlan, FreeSpace]:
    """The map and its free space, once per process."""
    plan = read_floor_plan(path, size, unknown)
    return plan, FreeSpace(plan, grid, radius, margin)


def _path(config: RoomConfig) -> Path:
    if config.path is not None:
        path = Path(config.path).expanduser()
        if not path.is_file():
            raise InputError(
                f"map.path is {config.path}: no such file; must be a shape file, ROS map or picture"
            )
        return path
    shipped = sorted(drawing.parent.name for drawing in resource_dir("maps").glob(f"*/{DRAWING}"))
    if config.name is None:
        raise InputError("map.path is null: must be a shape file (.yaml), a ROS map (.yaml) or a picture")
    if config.name not in shipped:
        raise InputError(
            f"map.name is {config.name!r}: must be one of {', '.join(shipped)}, or give map.path"
        )
    return resource_dir("maps") / config.name / DRAWING


def _size(config: RoomConfig) -> tuple[float, float] | None:
    return None if config.size is None else (config.size[0], config.size[1])
