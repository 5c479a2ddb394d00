"""Traps: obstacles that catch a planner that only heads for the goal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lme.errors import InputError, require
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.starts import STAGE_RADIUS, Starts, StartsConfig
from lme.worlds.trap_shapes import DRAWINGS, MIDDLE, SIDE, mixed
from lme.worlds.world import World

START = (1.5, MIDDLE)  # [m] starts are drawn around it
GOAL = (8.5, MIDDLE)  # [m]

KINDS = (*DRAWINGS, "mixed")


@dataclass(slots=True)
class TrapsConfig(StartsConfig):
    """Keys of `conf/map/traps.yaml`."""

    kind: str = "u"  # u | wall | door | zigzag | mixed
    door_margin: float = 0.3  # [m] by which a door is wider than the disc of `radius`

    def __post_init__(self) -> None:
        StartsConfig.__post_init__(self)  # super() fails in a dataclass with slots
        if self.kind not in KINDS:
            raise InputError(f"map.kind is {self.kind!r}: must be one of {', '.join(KINDS)}")
        require("map.door_margin", self.door_margin, at_least=2 * self.grid, at_most=1.0)


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
    """The trap in its room and its free space, computed once per process. seed: of a random trap; None: a fixed one."""
    if seed is None:
        legs = DRAWINGS[kind](door)
    else:  # 1 separates the trap's random stream from that of the start
        legs = mixed(np.random.default_rng(np.random.SeedSequence([*seed, 1])), door)
    walls = [{"points": leg} for leg in legs]
    plan = floor_plan(f"trap {kind}", {"bounds": [0.0, 0.0, SIDE, SIDE], "walls": walls})
    return plan.world, FreeSpace(plan, grid, radius, margin=0.0)
