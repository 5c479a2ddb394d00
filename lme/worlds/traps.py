"""Traps: four drawings between a robot and its goal that catch a planner which only heads for the goal."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lme.errors import InputError
from lme.robots import require
from lme.types import Pose
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.world import Task

SIDE = 10.0  # [m] of the room that the trap stands in
START = Pose(1.5, 5.0, 0.0)  # before it moves about
GOAL = (8.5, 5.0)  # [m]
STAGE_RADIUS = 0.2  # [m] of the paper's robot (§IV.A)

Legs = list[list[list[float]]]  # walls, each a list of [x, y] corners [m]


@dataclass(slots=True)
class TrapsConfig:
    """Keys of `conf/map/traps.yaml`."""

    kind: str = "u"  # u | wall | door | zigzag
    starts: int = 20  # numbers 0, 1, …
    worlds: list[int] | None = None  # these numbers instead
    start_seed: int = 0  # which stream of starts
    lateral: float = 0.3  # [m] a start lies so far to either side of the line to the goal
    turn: float = 0.3  # [rad] a start looks so far to either side of the goal
    door_margin: float = 0.3  # [m] a door is so much wider than the robot
    radius: float | None = None  # [m] of the disc that must be able to reach the goal; None: STAGE_RADIUS
    grid: float = 0.05  # [m] between the points that shortest paths are made of
    goal_tolerance: float = 0.2  # [m]
    time_limit: float = 120.0  # [s]
    clock_distance: float = 0.0  # [m]
    speed: float = 0.5  # [m/s] of the optimal time

    def __post_init__(self) -> None:
        if self.kind not in DRAWINGS:
            raise InputError(f"map.kind is {self.kind!r}: must be one of {', '.join(DRAWINGS)}")
        require("map.starts", self.starts, at_least=1)
        require("map.start_seed", self.start_seed, at_least=0)
        require("map.clock_distance", self.clock_distance, at_least=0.0)
        require("map.lateral", self.lateral, at_least=0.0, at_most=0.5)
        require("map.turn", self.turn, at_least=0.0, at_most=math.pi)
        if self.radius is not None:
            require("map.radius", self.radius, above=0.0, at_most=0.5)
        for key in ("grid", "goal_tolerance", "time_limit", "speed"):
            require(f"map.{key}", getattr(self, key), above=0.0)
        require("map.door_margin", self.door_margin, at_least=2 * self.grid, at_most=1.0)
        chosen = self.worlds
        if chosen is not None and (not chosen or len(set(chosen)) < len(chosen) or min(chosen) < 0):
            raise InputError(
                f"map.worlds is {list(chosen)}: must be different numbers from 0 on, at least one, or null"
            )


class Traps:
    """The same trap under every number, from another start."""

    Config = TrapsConfig

    def __init__(self, config: TrapsConfig) -> None:
        self.config = config
        radius = STAGE_RADIUS if config.radius is None else config.radius
        self._plan, self._space = _surveyed(config.kind, radius, config.door_margin, config.grid)
        self._numbers = tuple(range(config.starts) if config.worlds is None else config.worlds)
        self._lengths: dict[int, float] = {}

    @property
    def numbers(self) -> tuple[int, ...]:
        """The starts chosen, by their own numbers."""
        return self._numbers

    def task(self, number: int) -> Task:
        """The trap from start `number`; its shortest path is computed once."""
        if number not in self._numbers:
            raise InputError(f"start {number} is not among the chosen ones of map traps")
        config, start, goal = self.config, self._start(number), np.array(GOAL)
        if number not in self._lengths:
            self._lengths[number] = self._space.path_length(start, goal)
        length, straight = self._lengths[number], math.dist(start[:2], GOAL)
        return Task(
            map_name=f"trap_{config.kind}",
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

    def _start(self, number: int) -> Pose:
        rng = np.random.default_rng(np.random.SeedSequence([self.config.start_seed, number]))
        aside, turned = rng.uniform(-1.0, 1.0, 2).tolist()
        return START._replace(y=START.y + aside * self.config.lateral, yaw=turned * self.config.turn)


@lru_cache(maxsize=8)
def _surveyed(kind: str, radius: float, door_margin: float, grid: float) -> tuple[FloorPlan, FreeSpace]:
    """The trap in its room, and its free space, once per process."""
    walls = [{"points": leg} for leg in DRAWINGS[kind](2.0 * radius + door_margin)]
    plan = floor_plan(f"trap {kind}", {"bounds": [0.0, 0.0, SIDE, SIDE], "walls": walls})
    return plan, FreeSpace(plan, grid, radius, margin=0.0)


def _u(door: float) -> Legs:
    """2 × 2 m, open towards the start."""
    return [[[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]]]


def _wall(door: float) -> Legs:
    """4 m across the way."""
    return [[[5.0, 3.0], [5.0, 7.0]]]


def _door(door: float) -> Legs:
    """A wall across the room; its only door is 2.5 m off the way."""
    middle = 7.5
    return [[[5.0, 0.0], [5.0, middle - door / 2]], [[5.0, middle + door / 2], [5.0, SIDE]]]


def _zigzag(door: float) -> Legs:
    """Three walls, from alternate sides, each across the way and past the next one's end."""
    return [[[3.5, 0.0], [3.5, 6.5]], [[5.0, 3.5], [5.0, SIDE]], [[6.5, 0.0], [6.5, 6.5]]]


DRAWINGS: dict[str, Callable[[float], Legs]] = {"u": _u, "wall": _wall, "door": _door, "zigzag": _zigzag}
