"""One place and one goal under every number, each from another start: what traps and drawn scenes share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError, require
from lme.types import Floats, Pose
from lme.worlds.sampling import FreeSpace
from lme.worlds.world import Task, World

STAGE_RADIUS = 0.2  # [m] of the paper's robot (§IV.A)


@dataclass(slots=True)
class StartsConfig:
    """Keys that `conf/map/traps.yaml` and those of the scenes have in common."""

    starts: int = 20  # numbers 0, 1, …
    worlds: list[int] | None = None  # these numbers instead
    start_seed: int = 0  # which stream of starts
    lateral: float = 0.3  # [m] a start lies so far to either side of the line to the goal
    turn: float = 0.3  # [rad] a start looks so far to either side of the goal
    radius: float | None = None  # [m] of the disc that must be able to reach the goal; None: STAGE_RADIUS
    grid: float = 0.05  # [m] between the points that shortest paths are made of
    goal_tolerance: float = 0.2  # [m]
    time_limit: float = 120.0  # [s]
    clock_distance: float = 0.0  # [m]
    speed: float = 0.5  # [m/s] of the optimal time

    def __post_init__(self) -> None:
        require("map.starts", self.starts, at_least=1)
        require("map.start_seed", self.start_seed, at_least=0)
        require("map.clock_distance", self.clock_distance, at_least=0.0)
        require("map.lateral", self.lateral, at_least=0.0, at_most=0.5)
        require("map.turn", self.turn, at_least=0.0, at_most=math.pi)
        if self.radius is not None:
            require("map.radius", self.radius, above=0.0, at_most=0.5)
        for key in ("grid", "goal_tolerance", "time_limit", "speed"):
            require(f"map.{key}", getattr(self, key), above=0.0)
        check_worlds(self.worlds)


class Starts:
    """The same task under every number, from another start. Number n is the same whatever others are chosen."""

    def __init__(
        self, name: str, config: StartsConfig, world: World, space: FreeSpace, start: Floats, goal: Floats
    ) -> None:
        """name: in the records. start, goal: (2,) [m], the start before it moves about."""
        self.config = config
        self._name, self._world, self._space = name, world, space
        self._start, self._goal = start, goal
        self._numbers = tuple(range(config.starts) if config.worlds is None else config.worlds)
        self._lengths: dict[int, float] = {}

    @property
    def numbers(self) -> tuple[int, ...]:
        """The starts chosen, by their own numbers."""
        return self._numbers

    def task(self, number: int) -> Task:
        """The task from start `number`; its shortest path is computed once.

        Raises InputError for a number that was not chosen, for a start at the goal, and where no way there is
        wide enough.
        """
        if number not in self._numbers:
            raise InputError(f"start {number} is not among the chosen ones of map {self._name}")
        config = self.config
        start = moved_about(self._start, self._goal, config, number)
        straight = math.dist(start[:2], self._goal)
        if straight <= config.goal_tolerance:
            raise InputError(
                f"map {self._name}, start {number}: it lies {straight:.3g} m from the goal, within map.goal_tolerance "
                f"= {config.goal_tolerance:g} m: must begin further away"
            )
        length = self._length(number, start)
        return Task(
            map_name=self._name,
            number=number,
            world=self._world,
            start=start,
            goal=self._goal.copy(),
            goal_tolerance=config.goal_tolerance,
            time_limit=config.time_limit,
            clock_distance=config.clock_distance,
            shortest_path_length=length,
            optimal_time=length / config.speed,
            measures={"straight_m": straight, "detour": length / straight},
        )

    def _length(self, number: int, start: Pose) -> float:
        if number not in self._lengths:
            length = self._space.path_length(start, self._goal)
            if not math.isfinite(length):
                raise InputError(
                    f"map {self._name}, start {number}: no way to the goal is wide enough for the disc around "
                    "the robot (map.radius): must be a smaller robot, or another map"
                )
            self._lengths[number] = length
        return self._lengths[number]


def moved_about(start: Floats, goal: Floats, config: StartsConfig, number: int) -> Pose:
    """Start `number`: a step aside of the line from start (2,) to goal (2,) [m], and a turn from facing it."""
    rng = np.random.default_rng(np.random.SeedSequence([config.start_seed, number]))
    aside, turned = rng.uniform(-1.0, 1.0, 2).tolist()
    ahead = math.atan2(goal[1] - start[1], goal[0] - start[0])
    step = aside * config.lateral
    x, y = start[0] - step * math.sin(ahead), start[1] + step * math.cos(ahead)
    return Pose(float(x), float(y), ahead + turned * config.turn)


def check_worlds(chosen: list[int] | None) -> None:
    """Raise InputError unless these are numbers that a map set can be asked for, or None."""
    if chosen is not None and (not chosen or len(set(chosen)) < len(chosen) or min(chosen) < 0):
        raise InputError(
            f"map.worlds is {list(chosen)}: must be different numbers from 0 on, at least one, or null"
        )
