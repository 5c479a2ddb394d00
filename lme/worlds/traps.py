"""Traps: obstacles that catch a planner that only heads for the goal, and the shapes that they are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lme.errors import argument_error, require
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.starts import STAGE_RADIUS, Starts, StartsConfig
from lme.worlds.world import World

SIDE = 10.0  # [m] of the square room around the trap
MIDDLE = SIDE / 2  # [m] y of start and goal

Legs = list[list[list[float]]]  # walls, each a list of [x, y] corners [m]
Uniform = Callable[[float, float], float]
START = (1.5, MIDDLE)  # [m] starts are drawn around it
GOAL = (8.5, MIDDLE)  # [m]


def mixed(rng: np.random.Generator, door: float) -> Legs:
    """Draw a trap of random kind and size, mirrored half of the time. door: least width of a way [m], at most 2."""
    legs = _RANDOM[int(rng.integers(len(_RANDOM)))](rng.uniform, door)
    return [[[x, SIDE - y] for x, y in leg] for leg in legs] if rng.random() < 0.5 else legs


def drawing(kind: str, door: float) -> Legs:
    """Return the walls of a trap of fixed kind. door: width of the door [m]."""
    middle = 7.5  # of the door
    return {
        # A U of 2 × 2 m, open towards the start
        "u": [[[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]]],
        # A wall 4 m long, across the straight line to the goal
        "wall": [[[5.0, 3.0], [5.0, 7.0]]],
        # A wall across the room; its only door is 2.5 m off the straight line to the goal
        "door": [[[5.0, 0.0], [5.0, middle - door / 2]], [[5.0, middle + door / 2], [5.0, SIDE]]],
        # Three walls from alternate sides; each crosses the straight line to the goal and overlaps the next
        "zigzag": [[[3.5, 0.0], [3.5, 6.5]], [[5.0, 3.5], [5.0, SIDE]], [[6.5, 0.0], [6.5, 6.5]]],
    }[kind]


def _random_u(draw: Uniform, door: float) -> Legs:
    """A U, open towards the start."""
    return [_cup(draw(2.8, 4.5), draw(1.0, 2.5), draw(0.8, 2.5), draw(0.8, 2.5))]


def _deep_u(draw: Uniform, door: float) -> Legs:
    """A narrow U, open towards the start."""
    return [_cup(draw(2.6, 3.2), draw(3.0, 4.5), draw(0.7, 1.2), draw(0.7, 1.2))]


def _bent_u(draw: Uniform, door: float) -> Legs:
    """A U with one end turned in, which closes part of its mouth."""
    x, below, above = draw(2.8, 4.0), draw(1.2, 2.3), draw(1.2, 2.3)
    lip = draw(0.3, 0.9) * (below + above - door)
    return [[*_cup(x, draw(1.5, 3.0), below, above), [x, MIDDLE + above - lip]]]


def _random_wall(draw: Uniform, door: float) -> Legs:
    """A wall across the straight line to the goal, up to 27° from perpendicular."""
    x, lean = draw(3.5, 6.5), draw(-0.5, 0.5)
    below, above = draw(1.0, 2.8), draw(1.0, 2.8)
    return [[[x - lean * below, MIDDLE - below], [x + lean * above, MIDDLE + above]]]


def _hook(draw: Uniform, door: float) -> Legs:
    """A wall across the straight line; one end turns back to the start."""
    x, end = draw(4.5, 6.5), MIDDLE + draw(0.6, 2.0)
    return [[[x, MIDDLE - draw(0.8, 2.5)], [x, end], [x - draw(0.8, 2.0), end]]]


def _dead_end(draw: Uniform, door: float) -> Legs:
    """A corridor in which the robot starts; the only way out is next to the start."""
    low, high, end = MIDDLE - draw(1.1, 1.6), MIDDLE + draw(1.1, 1.6), draw(5.5, 7.5)
    return [[[0.0, low], [end, low], [end, high], [draw(3.0, 4.5), high]]]


def _random_door(draw: Uniform, door: float) -> Legs:
    """A wall across the room, with its only door off the straight line."""
    x, middle = draw(3.5, 6.5), MIDDLE + draw(1.8, 3.2)
    return [[[x, 0.0], [x, middle - door / 2]], [[x, middle + door / 2], [x, SIDE]]]


def _random_zigzag(draw: Uniform, door: float) -> Legs:
    """Three walls from alternate sides, each across the straight line."""
    step = max(draw(1.3, 2.0), door)
    ends = [MIDDLE + draw(0.6, 2.0), MIDDLE - draw(0.6, 2.0), MIDDLE + draw(0.6, 2.0)]
    points = [(MIDDLE - step, 0.0), (MIDDLE, SIDE), (MIDDLE + step, 0.0)]
    return [[[x, y], [x, end]] for (x, y), end in zip(points, ends, strict=True)]


def _cup(x: float, depth: float, below: float, above: float) -> list[list[float]]:
    """Three sides of a rectangle, open at x; it reaches this far below and above the middle [m]."""
    low, high = MIDDLE - below, MIDDLE + above
    return [[x, low], [x + depth, low], [x + depth, high], [x, high]]


_RANDOM = (
    _random_u, _deep_u, _bent_u, _random_wall, _hook, _dead_end, _random_door, _random_zigzag
)  # fmt: skip


DRAWINGS = ("u", "wall", "door", "zigzag")
KINDS = (*DRAWINGS, "mixed")


@dataclass(slots=True)
class TrapsConfig(StartsConfig):
    """Keys of `conf/map/traps.yaml`."""

    kind: str
    door_margin: float

    def __post_init__(self) -> None:
        StartsConfig.__post_init__(self)  # super() fails in a dataclass with slots
        if self.kind not in KINDS:
            raise argument_error(f"kind is {self.kind!r}: must be one of {', '.join(KINDS)}")
        require("door_margin", self.door_margin, at_least=2 * self.grid, at_most=1.0)


class Traps(Starts):
    """The same trap from a different start for every number; with kind mixed, a different trap too."""

    Config = TrapsConfig

    def __init__(self, config: TrapsConfig) -> None:
        self._radius = STAGE_RADIUS if config.radius is None else config.radius
        self._kind, self._door = config.kind, 2.0 * self._radius + config.door_margin
        super().__init__(f"trap_{config.kind}", config, self._site, np.array(START), np.array(GOAL))

    def _site(self, number: int) -> tuple[World, FreeSpace]:
        seed = (self.config.start_seed, number) if self._kind == "mixed" else None
        return _surveyed(self._kind, self._door, seed, self._radius, self.config.grid)


@lru_cache(maxsize=8)
def _surveyed(
    kind: str, door: float, seed: tuple[int, int] | None, radius: float, grid: float
) -> tuple[World, FreeSpace]:
    """The trap in its room and its free space, computed once per process.

    seed: seed of a random trap; None for a fixed one.
    """
    # A 1 separates the trap's random stream from that of the start.
    legs = drawing(kind, door) if seed is None else mixed(np.random.default_rng([*seed, 1]), door)
    walls = [{"points": leg} for leg in legs]
    plan = floor_plan(f"trap {kind}", {"bounds": [0.0, 0.0, SIDE, SIDE], "walls": walls})
    return plan.world, FreeSpace(plan, grid, radius, margin=0.0)
