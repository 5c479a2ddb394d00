"""The BARN benchmark: 300 official worlds, published files, or fresh worlds of the same kind.

Protocol: the benchmark's `run.py` (Daffan/the-barn-challenge); worlds: Perille et al. 2020, arXiv:2008.13315.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass, field

import numpy as np

from lme.errors import InputError, require
from lme.types import Pose
from lme.worlds.barn.files import find_worlds
from lme.worlds.barn.generator import official_recipes
from lme.worlds.barn.layouts import Layout, fresh_layout, official_layout, published_layout
from lme.worlds.barn.measures import barn_measures
from lme.worlds.barn.path import OPTIMAL_SPEED_M_S, benchmark_length, inflated
from lme.worlds.world import Task, World

SUBSETS = ("all", "official50", "hard100", "fresh")
FIRST_FRESH = 1000  # number of the first fresh world, so that records never mix them with official ones

_OFFICIAL = {"all": range(300), "official50": range(0, 300, 6), "hard100": range(200, 300)}


@dataclass(slots=True)
class BarnConfig:
    """Keys of `conf/map/barn.yaml`."""

    subset: str = "hard100"  # all | official50 | hard100 | fresh
    source: str | None = None  # folder with the published files; None: regenerate them
    worlds: list[int] | None = None  # these numbers instead of the subset's
    count: int = 100  # how many fresh worlds
    fresh_seed: int = 0  # which stream of fresh worlds
    start: list[float] = field(default_factory=lambda: [-2.25, 3.0, math.pi / 2])  # x, y [m], yaw [rad]
    goal: list[float] = field(default_factory=lambda: [-2.25, 13.0])  # x, y [m]
    goal_tolerance: float = 1.0  # [m]
    time_limit: float = 100.0  # [s]
    clock_distance: float = 0.1  # [m]

    def __post_init__(self) -> None:
        if self.subset not in SUBSETS:
            raise InputError(
                f"map.subset is {self.subset!r}: must be one of {', '.join(SUBSETS)}" + _nearest(self.subset)
            )
        if self.subset == "fresh" and self.source is not None:
            raise InputError(
                f"map.source is {self.source}: must be null with map.subset=fresh, which is generated"
            )
        require("map.count", self.count, at_least=1)
        require("map.fresh_seed", self.fresh_seed, at_least=0)
        require("map.goal_tolerance", self.goal_tolerance, above=0)
        require("map.time_limit", self.time_limit, above=0)
        require("map.clock_distance", self.clock_distance, at_least=0)
        _check_numbers("map.start", self.start, "three finite numbers: x, y [m], yaw [rad]", 3)
        _check_numbers("map.goal", self.goal, "two finite numbers: x, y [m]", 2)


class Barn:
    """BARN worlds under their official numbers; fresh ones count from 1000."""

    Config = BarnConfig

    def __init__(self, config: BarnConfig) -> None:
        """Raises InputError where worlds that were asked for are not there; files are read by `task`."""
        self.config = config
        self._files = None if config.source is None else find_worlds(config.source)
        self._numbers = self._chosen()

    @property
    def numbers(self) -> tuple[int, ...]:
        """The worlds chosen, by their own numbers."""
        return self._numbers

    def task(self, number: int) -> Task:
        """Build world `number`; InputError for a published file that is broken."""
        return self._task(number, self.layout(number))

    def layout(self, number: int) -> Layout:
        """Cylinders, grid, the benchmark's path and the recipe of world `number`."""
        if number not in self._numbers:
            raise InputError(f"world {number} is not among the chosen worlds of map barn")
        if self._files is not None:
            return published_layout(number, self._files[number])
        if self.config.subset == "fresh":
            return fresh_layout(self.config.fresh_seed, number - FIRST_FRESH)
        return official_layout(number)

    def _task(self, number: int, layout: Layout) -> Task:
        config = self.config
        start, goal = Pose(*config.start), np.array(config.goal, dtype=np.float64)
        length = benchmark_length(layout.path, start, goal)
        return Task(
            map_name="barn",
            number=number,
            world=World(circles=layout.cylinders),
            start=start,
            goal=goal,
            goal_tolerance=config.goal_tolerance,
            time_limit=config.time_limit,
            clock_distance=config.clock_distance,
            shortest_path_length=length,
            optimal_time=length / OPTIMAL_SPEED_M_S,
            measures=_measures(layout),
        )

    def _chosen(self) -> tuple[int, ...]:
        """Numbers of `worlds` or of the subset; InputError names those that are not there."""
        config = self.config
        asked = config.worlds
        if asked is None:
            if config.subset == "fresh":
                return tuple(range(FIRST_FRESH, FIRST_FRESH + config.count))
            asked = list(_OFFICIAL[config.subset])
            if self._files is not None and config.subset == "all":
                asked = list(self._files)
        elif not asked or len(set(asked)) < len(asked):
            raise InputError(
                f"map.worlds is {list(asked)}: must be different world numbers, at least one, or null"
            )
        absent = [number for number in asked if not self._has(number)]
        if absent:
            raise InputError(self._absence(absent))
        return tuple(asked)

    def _has(self, number: int) -> bool:
        if self._files is not None:
            return number in self._files
        return number >= FIRST_FRESH if self.config.subset == "fresh" else number in official_recipes()

    def _absence(self, absent: list[int]) -> str:
        config = self.config
        some = ", ".join(map(str, absent[:5])) + (f" and {len(absent) - 5} more" if len(absent) > 5 else "")
        if self._files is not None:
            key = f"map.subset is {config.subset!r}" if config.worlds is None else "map.worlds"
            return f"{key} asks for worlds that map.source {config.source} does not hold: {some}"
        right = f"from {FIRST_FRESH} on with map.subset=fresh" if config.subset == "fresh" else "0 to 299"
        return f"map.worlds asks for {some}: must be {right}"


def _measures(layout: Layout) -> dict[str, float]:
    """Cylinders, fill, the five difficulty measures, and the smoothings of the recipe where it is known."""
    smoothings = {} if layout.recipe is None else {"smoothings": float(layout.recipe.smoothings)}
    counts = {"cylinders": float(len(layout.cylinders)), "fill": layout.fill}
    return {**counts, **smoothings, **barn_measures(inflated(layout.grid), layout.path)}


def _nearest(word: str) -> str:
    close = difflib.get_close_matches(word, SUBSETS, n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else ""


def _check_numbers(key: str, values: list[float], right: str, count: int) -> None:
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise InputError(f"{key} is {list(values)}: must be {right}")
