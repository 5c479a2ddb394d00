"""Settings that the configs of all map sets share: the worlds to drive, and the rules that end an episode."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lme.errors import InputError, argument_error, config_key, require
from lme.inputs import plausibility
from lme.inputs.guarded_file import expanded
from lme.robots import Robot
from lme.types import Floats, Pose
from lme.worlds.world import Task, World

MOST_WORLDS = 10_000_000  # of a map set, which lists their numbers
STAGE_V_MAX = 0.5  # [m/s] of the paper's robot (§IV.A)
TIME_FACTOR, LEAST_TIME = 8.0, 60.0  # of a time limit that follows from the shortest path: see `fair_limit`


@dataclass(slots=True)
class TaskRules:
    """Keys of every YAML in `conf/map/`."""

    worlds: list[int] | None
    goal_tolerance: float
    time_limit: float | None
    clock_distance: float

    def __post_init__(self) -> None:
        require("goal_tolerance", self.goal_tolerance, above=0.0)
        plausibility.check(config_key("goal_tolerance"), self.goal_tolerance)
        if self.time_limit is not None:
            require("time_limit", self.time_limit, above=0.0)
            plausibility.check(config_key("time_limit"), self.time_limit)
        require("clock_distance", self.clock_distance, at_least=0.0)
        worlds = self.worlds
        if worlds is not None and (not worlds or len(set(worlds)) < len(worlds) or min(worlds) < 0):
            raise argument_error(
                f"worlds is {list(worlds)}: must be different numbers from 0 on, at least one, or null"
            )

    def numbers(self, offered: Iterable[int]) -> tuple[int, ...]:
        """The numbers of the worlds to drive, out of those that the map set offers."""
        return tuple(offered if self.worlds is None else self.worlds)

    def limit(self, length: float) -> float:
        """The time limit [s] of a task whose shortest path has this length [m]. Raises InputError if there is none."""
        if self.time_limit is None:
            raise argument_error("time_limit is null: must be given in seconds for this map set")
        return self.time_limit

    def task(
        self,
        map_name: str,
        number: int,
        world: World,
        start: Pose,
        goal: Floats,
        *,
        length: float,
        speed: float,
        measures: dict[str, float],
    ) -> Task:
        """Build a task with these rules.

        goal: (2,) [m]. length: length of the shortest path [m]; the optimal time is that at `speed` [m/s].
        Raises InputError for a start that is within the goal tolerance.
        """
        straight = math.dist(start[:2], goal)
        if straight <= self.goal_tolerance:
            raise InputError(
                f"map {map_name}, world {number}: the start lies {straight:.3g} m from the goal, within "
                f"goal_tolerance = {self.goal_tolerance:g} m: must be further away"
            )
        return Task(
            map_name=map_name,
            number=number,
            world=world,
            start=start,
            goal=goal,
            goal_tolerance=self.goal_tolerance,
            time_limit=self.limit(length),
            clock_distance=self.clock_distance,
            shortest_path_length=length,
            optimal_time=length / speed,
            measures=measures,
        )


@dataclass(slots=True)
class PacedRules(TaskRules):
    """Rules of a map set whose optimal time is that of the shortest path, at the robot's full speed or a given one."""

    speed: float | None
    v_max: float | None

    def __post_init__(self) -> None:
        TaskRules.__post_init__(self)  # super() fails in a dataclass with slots
        for key in ("speed", "v_max"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)

    @property
    def full_speed(self) -> float:
        """The robot's full speed [m/s]."""
        return STAGE_V_MAX if self.v_max is None else self.v_max

    @property
    def pace(self) -> float:
        """The speed that the optimal time assumes [m/s]."""
        return self.full_speed if self.speed is None else self.speed

    def limit(self, length: float) -> float:
        """The time limit [s] of a task whose shortest path has this length [m]: the given one, or `fair_limit`."""
        return fair_limit(length / self.full_speed) if self.time_limit is None else self.time_limit


@dataclass(slots=True)
class DrawnRules(PacedRules):
    """Rules of a map set that draws pairs of start and goal in the free space of a map."""

    configurations: int
    sample_seed: int
    min_distance: float
    radius: float | None
    margin: float
    grid: float

    def __post_init__(self) -> None:
        PacedRules.__post_init__(self)  # super() fails in a dataclass with slots
        require("configurations", self.configurations, at_least=1, at_most=MOST_WORLDS)
        for key in ("sample_seed", "min_distance", "margin"):
            require(key, getattr(self, key), at_least=0.0)
        if self.radius is not None:
            require("radius", self.radius, above=0.0)
        require("grid", self.grid, above=0.0)


def fair_limit(fastest: float, factor: float = TIME_FACTOR, min_limit: float = LEAST_TIME) -> float:
    """The time limit [s] of a task whose shortest path takes `fastest` [s] at the robot's full speed."""
    return max(min_limit, factor * fastest)


def with_robot(values: Mapping[str, Any], robot: Robot) -> dict[str, Any]:
    """Return the values of a map set's keys, with those of the robot for a `radius` and a `v_max` of null."""
    defaults = {"radius": robot.footprint.circumscribed_radius, "v_max": robot.v_max}
    return {**values, **{key: defaults[key] for key in defaults if key in values and values[key] is None}}


def path_measures(length: float, straight: float) -> dict[str, float]:
    """Measures of a task: the straight distance to the goal [m], and the length of the path as a multiple of it."""
    return {"straight_m": straight, "detour": length / straight if straight else 1.0}


def map_path(value: str, right: str) -> Path:
    """Return the file that `path` names. right: what it must be. Raises InputError if it is not a file."""
    path = expanded(value)
    if not path.is_file():
        problem = "is a directory" if path.is_dir() else "no such file"
        raise argument_error(f"path is {value}: {problem}; must be {right}")
    return path


def check_numbers(key: str, values: list[float], counts: tuple[int, ...], right: str) -> None:
    """Raise InputError unless the values are finite and as many as one of `counts`. right: what they must be."""
    if len(values) not in counts or not all(map(math.isfinite, values)):
        raise argument_error(f"{key} is {list(values)}: must be {right}")


def check_chosen(number: int, numbers: tuple[int, ...], kind: str, map_name: str) -> None:
    """Raise InputError if world `number` is not among the chosen `numbers`. kind: what a number stands for."""
    if number not in numbers:
        raise InputError(f"{kind} {number} is not among the chosen ones of map {map_name}")
