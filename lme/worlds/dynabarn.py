"""A crossing of an arena with moving cylinders: DynaBARN's setting, with motion of our own.

Arena, cylinders, start, goal and time-out are those of the 60 published worlds (Nair et al. 2022, "DynaBARN:
Benchmarking Metric Ground Navigation in Dynamic Environments", doi:10.1109/SSRR56537.2022.10018758; files in
Daffan/the-barn-challenge). How the published cylinders move is only in compiled plugins. Motion here is our own,
in their manner: each cylinder crosses the arena from border to border on a smooth curve, at a speed of its own and
through the others; at the border it turns back, where theirs begin anew.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import InputError, require
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.starts import check_worlds
from lme.worlds.world import Task, World

START = Pose(11.0, 0.0, math.pi)  # before the open side of the arena
GOAL = (-9.0, 0.0)  # [m] 20 m straight ahead
RADIUS = 0.5  # [m] of a cylinder
HALF_SIDE = 10.0  # [m] of the arena, to the middle of its walls
WALL = 0.5  # [m] thick
WORLDS = 60  # published

_FURTHEST = HALF_SIDE - WALL / 2 - RADIUS  # [m] a cylinder's middle along either axis: no wall is touched
_SHORTEST = HALF_SIDE  # [m] from end to end of a crossing
_BOW = 0.2  # of the way from end to end: how far a curve may swing aside; 4 bends turn within 1.2 m then
_STEP_M = 0.1  # between waypoints at most: corners cut a curve of 1.2 m radius by 1 mm


class Motion(NamedTuple):
    """What a difficulty draws from: cylinders (least, most), their speed [m/s], bends of a curve (least, most)."""

    cylinders: tuple[int, int]
    speed: tuple[float, float]
    bends: tuple[int, int]


DIFFICULTIES = {
    "easy": Motion((5, 10), (0.2, 0.6), (1, 1)),
    "medium": Motion((11, 17), (0.5, 1.0), (1, 2)),
    "hard": Motion((18, 24), (0.8, 1.5), (2, 4)),
}


@dataclass(slots=True)
class DynabarnConfig:
    """Keys of `conf/map/dynabarn.yaml`."""

    difficulty: str = "medium"  # easy | medium | hard
    worlds: list[int] | None = None  # these worlds instead of 0–59
    motion_seed: int = 0  # which stream of worlds
    goal_tolerance: float = 1.0  # [m]
    time_limit: float = 100.0  # [s]
    clock_distance: float = 0.1  # [m]
    speed: float = 2.0  # [m/s] of the optimal time

    def __post_init__(self) -> None:
        if self.difficulty not in DIFFICULTIES:
            raise InputError(
                f"map.difficulty is {self.difficulty!r}: must be one of {', '.join(DIFFICULTIES)}"
            )
        require("map.motion_seed", self.motion_seed, at_least=0)
        require("map.clock_distance", self.clock_distance, at_least=0.0)
        for key in ("goal_tolerance", "time_limit", "speed"):
            require(f"map.{key}", getattr(self, key), above=0.0)
        check_worlds(self.worlds)


class Dynabarn:
    """Worlds under their numbers. Number n is the same whatever others are chosen."""

    Config = DynabarnConfig

    def __init__(self, config: DynabarnConfig) -> None:
        self.config = config
        self._numbers = tuple(range(WORLDS) if config.worlds is None else config.worlds)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The worlds chosen, by their own numbers."""
        return self._numbers

    def task(self, number: int) -> Task:
        """World `number`. Raises InputError for one that was not chosen."""
        if number not in self._numbers:
            raise InputError(f"world {number} is not among the chosen ones of map dynabarn")
        config = self.config
        motion = DIFFICULTIES[config.difficulty]
        stream = [config.motion_seed, list(DIFFICULTIES).index(config.difficulty), number]
        cylinders = movers(np.random.default_rng(np.random.SeedSequence(stream)), motion)
        length = math.dist(START[:2], GOAL)
        return Task(
            map_name=f"dynabarn_{config.difficulty}",
            number=number,
            world=World(polygons=_walls(), movers=cylinders),
            start=START,
            goal=np.array(GOAL),
            goal_tolerance=config.goal_tolerance,
            time_limit=config.time_limit,
            clock_distance=config.clock_distance,
            shortest_path_length=length,
            optimal_time=length / config.speed,
            measures={
                "cylinders": float(len(cylinders)),
                "mean_speed_mps": float(np.mean([mover.speed for mover in cylinders])),
            },
        )


def movers(rng: np.random.Generator, motion: Motion) -> tuple[Mover, ...]:
    """The cylinders of one world."""
    count = rng.integers(*motion.cylinders, endpoint=True)
    return tuple(
        Mover(
            path=_there_and_back(rng, crossing(rng, int(rng.integers(*motion.bends, endpoint=True)))),
            radius=RADIUS,
            speed=rng.uniform(*motion.speed),
            repeat="cycle",
        )
        for _ in range(count)
    )


def crossing(rng: np.random.Generator, bends: int) -> Floats:
    """(P, 2) waypoints [m], evenly spaced, of a smooth curve between two places on the border of the arena.

    Aside of the straight line it is a sum of sines, the k-th with k half waves and at most _BOW / k² high: it turns
    no tighter than 1 / (bends · π² · _BOW) of its length, and meets no wall.
    """
    waves = np.arange(1, bends + 1)
    while True:
        start, end = _border_place(rng), _border_place(rng)
        if math.dist(start, end) < _SHORTEST:
            continue
        height = rng.uniform(-_BOW, _BOW, bends) / waves**2
        part = np.linspace(0.0, 1.0, 512)[:, None]
        aside = np.sin(math.pi * part * waves) @ height
        along = end - start
        curve = start + part * along + aside[:, None] * np.array([-along[1], along[0]])
        if np.abs(curve).max() <= _FURTHEST:
            return _evenly(curve)


def _border_place(rng: np.random.Generator) -> Floats:
    """(2,) as far out as a cylinder can be."""
    place = np.array([rng.uniform(-_FURTHEST, _FURTHEST), rng.choice([-_FURTHEST, _FURTHEST])])
    return place if rng.random() < 0.5 else place[::-1].copy()


def _there_and_back(rng: np.random.Generator, curve: Floats) -> Floats:
    """The round trip on a curve (P, 2) as a closed list of waypoints, from a random one on."""
    ring = np.vstack([curve, curve[-2:0:-1]])
    return np.roll(ring, int(rng.integers(len(ring))), axis=0)


def _evenly(curve: Floats) -> Floats:
    """Points (P, 2) at equal distances along a polyline (K, 2), at most _STEP_M apart."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(curve, axis=0).T))])
    places = np.linspace(0.0, along[-1], math.ceil(along[-1] / _STEP_M) + 1)
    return np.column_stack([np.interp(places, along, curve[:, axis]) for axis in (0, 1)])


def _walls() -> tuple[Floats, ...]:
    """Behind the goal and to both sides; the side that the robot comes from is open."""
    half, depth = HALF_SIDE, WALL / 2
    behind = (-half, 0.0, depth, half)
    left, right = (0.0, half, half, depth), (0.0, -half, half, depth)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return tuple(signs * (a, b) + (x, y) for x, y, a, b in (behind, left, right))
