"""DynaBARN's arena of moving cylinders, with our own cylinder motion.

Arena, cylinders, start, goal and time limit are those of the 60 published worlds (Nair et al. 2022, "DynaBARN:
Benchmarking Metric Ground Navigation in Dynamic Environments", doi:10.1109/SSRR56537.2022.10018758; files in
Daffan/the-barn-challenge). The motion of the published cylinders exists only in compiled plugins. Ours is similar:
each cylinder crosses the arena from border to border on a smooth curve, at its own constant speed, and passes
through the others. At the border it turns back; the published ones start again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import argument_error, require
from lme.geometry.polyline import evenly_spaced
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.rules import PacedRules, check_chosen
from lme.worlds.world import Task, World

START = Pose(11.0, 0.0, math.pi)  # before the open side of the arena
GOAL = (-9.0, 0.0)  # [m] 20 m straight ahead
RADIUS = 0.5  # [m] of a cylinder
HALF_SIDE = 10.0  # [m] of the arena, to the middle of its walls
WALL = 0.5  # [m] thick
WORLDS = 60  # published

_FURTHEST = HALF_SIDE - WALL / 2 - RADIUS  # [m] greatest |x| or |y| of a cylinder, clear of the walls
_SHORTEST = HALF_SIDE  # [m] least distance between the ends of a crossing
_BOW = 0.2  # greatest swing of a curve, as a share of its end-to-end distance; 4 bends have radius 1.2 m then
_STEP_M = 0.1  # greatest distance between waypoints; the polyline is within 1 mm of a curve of radius 1.2 m


class Motion(NamedTuple):
    """(least, most) of what is drawn at a difficulty: number of cylinders, speed [m/s], bends of a curve."""

    cylinders: tuple[int, int]
    speed: tuple[float, float]
    bends: tuple[int, int]


DIFFICULTIES = {
    "easy": Motion((5, 10), (0.2, 0.6), (1, 1)),
    "medium": Motion((11, 17), (0.5, 1.0), (1, 2)),
    "hard": Motion((18, 24), (0.8, 1.5), (2, 4)),
}


@dataclass(slots=True)
class DynabarnConfig(PacedRules):
    """Keys of `conf/map/dynabarn.yaml`."""

    difficulty: str
    motion_seed: int
    time_limit: float
    speed: float

    def __post_init__(self) -> None:
        PacedRules.__post_init__(self)  # super() fails in a dataclass with slots
        if self.difficulty not in DIFFICULTIES:
            raise argument_error(
                f"difficulty is {self.difficulty!r}: must be one of {', '.join(DIFFICULTIES)}"
            )
        require("motion_seed", self.motion_seed, at_least=0)


class Dynabarn:
    """Worlds by number. World n does not depend on which others are chosen."""

    Config = DynabarnConfig

    def __init__(self, config: DynabarnConfig) -> None:
        self.config = config
        self.numbers = config.numbers(range(WORLDS))

    def task(self, number: int) -> Task:
        """Build world `number`. Raises InputError for one that was not chosen."""
        check_chosen(number, self.numbers, "world", "dynabarn")
        config = self.config
        motion = DIFFICULTIES[config.difficulty]
        stream = [config.motion_seed, list(DIFFICULTIES).index(config.difficulty), number]
        cylinders = movers(np.random.default_rng(stream), motion)
        length = math.dist(START[:2], GOAL)
        return config.task(
            f"dynabarn_{config.difficulty}",
            number,
            World(polygons=_walls(), movers=cylinders),
            START,
            np.array(GOAL),
            length=length,
            speed=config.pace,
            measures={
                "cylinders": float(len(cylinders)),
                "mean_speed_mps": float(np.mean([mover.speed for mover in cylinders])),
            },
        )


def movers(rng: np.random.Generator, motion: Motion) -> tuple[Mover, ...]:
    """Draw the cylinders of one world."""
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
    """(P, 2) evenly spaced waypoints [m] of a smooth curve between two places on the border of the arena.

    The curve's offset from the straight line is a sum of sines; the k-th has k half waves and an amplitude of at
    most _BOW / k². So its radius is at least 1 / (bends · π² · _BOW) of its length. It touches no wall.
    """
    waves = np.arange(1, bends + 1)
    while True:
        start, end = _border_place(rng), _border_place(rng)
        if math.dist(start, end) < _SHORTEST:
            continue
        # Offset from the straight line, as a share of its length: Σ height_k sin(k π part), |height_k| ≤ _BOW / k².
        height = rng.uniform(-_BOW, _BOW, bends) / waves**2
        part = np.linspace(0.0, 1.0, 512)[:, None]
        offset = np.sin(math.pi * part * waves) @ height
        along = end - start
        curve = start + part * along + offset[:, None] * np.array([-along[1], along[0]])
        if np.abs(curve).max() <= _FURTHEST:
            return evenly_spaced(curve, _STEP_M)


def _border_place(rng: np.random.Generator) -> Floats:
    """(2,) a random place as near the border as a cylinder can be [m]."""
    position = np.array([rng.uniform(-_FURTHEST, _FURTHEST), rng.choice([-_FURTHEST, _FURTHEST])])
    return position if rng.random() < 0.5 else position[::-1].copy()


def _there_and_back(rng: np.random.Generator, curve: Floats) -> Floats:
    """Draw a round trip on a curve (P, 2), which begins at a random waypoint."""
    ring = np.vstack([curve, curve[-2:0:-1]])
    return np.roll(ring, int(rng.integers(len(ring))), axis=0)


def _walls() -> tuple[Floats, ...]:
    """The walls behind the goal and on both sides; the robot's side is open."""
    half, depth = HALF_SIDE, WALL / 2
    behind = (-half, 0.0, depth, half)
    left, right = (0.0, half, half, depth), (0.0, -half, half, depth)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return tuple(signs * (a, b) + (x, y) for x, y, a, b in (behind, left, right))
