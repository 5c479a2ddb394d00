"""Traps: four obstacles that catch a planner which only heads for the goal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lme.errors import InputError, require
from lme.worlds.floor_plan import FloorPlan
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.starts import STAGE_RADIUS, Starts, StartsConfig

SIDE = 10.0  # [m] of the square room around the trap
START = (1.5, 5.0)  # [m] starts are drawn around it
GOAL = (8.5, 5.0)  # [m]

Legs = list[list[list[float]]]  # walls, each a list of [x, y] corners [m]


@dataclass(slots=True)
class TrapsConfig(StartsConfig):
    """Keys of `conf/map/traps.yaml`."""

    kind: str = "u"  # u | wall | door | zigzag
    door_margin: float = 0.3  # [m] by which a door is wider than the disc of `radius`

    def __post_init__(self) -> None:
        StartsConfig.__post_init__(self)  # super() fails in a dataclass with slots
        if self.kind not in DRAWINGS:
            raise InputError(f"map.kind is {self.kind!r}: must be one of {', '.join(DRAWINGS)}")
        require("map.door_margin", self.door_margin, at_least=2 * self.grid, at_most=1.0)


class Traps(Starts):
    """The same trap from another start under every number."""

    Config = TrapsConfig

    def __init__(self, config: TrapsConfig) -> None:
        radius = STAGE_RADIUS if config.radius is None else config.radius
        plan, space = _surveyed(config.kind, radius, config.door_margin, config.grid)
        super().__init__(f"trap_{config.kind}", config, plan.world, space, np.array(START), np.array(GOAL))


@lru_cache(maxsize=8)
def _surveyed(kind: str, radius: float, door_margin: float, grid: float) -> tuple[FloorPlan, FreeSpace]:
    """The trap in its room and its free space, computed once per process."""
    walls = [{"points": leg} for leg in DRAWINGS[kind](2.0 * radius + door_margin)]
    plan = floor_plan(f"trap {kind}", {"bounds": [0.0, 0.0, SIDE, SIDE], "walls": walls})
    return plan, FreeSpace(plan, grid, radius, margin=0.0)


def _u(door: float) -> Legs:
    """2 × 2 m, open towards the start."""
    return [[[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0]]]


def _wall(door: float) -> Legs:
    """4 m long, across the straight line to the goal."""
    return [[[5.0, 3.0], [5.0, 7.0]]]


def _door(door: float) -> Legs:
    """A wall across the room; its only door is 2.5 m beside the straight line to the goal."""
    middle = 7.5
    return [[[5.0, 0.0], [5.0, middle - door / 2]], [[5.0, middle + door / 2], [5.0, SIDE]]]


def _zigzag(door: float) -> Legs:
    """Three walls from alternate sides; each crosses the straight line to the goal and overlaps the next."""
    return [[[3.5, 0.0], [3.5, 6.5]], [[5.0, 3.5], [5.0, SIDE]], [[6.5, 0.0], [6.5, 6.5]]]


DRAWINGS: dict[str, Callable[[float], Legs]] = {"u": _u, "wall": _wall, "door": _door, "zigzag": _zigzag}
