"""The BARN benchmark: the 300 official worlds, published files, or new worlds of the same kind.

Subsets of the official worlds come in the order of their numbers, which is the benchmark's order of difficulty.
Protocol: the benchmark's `run.py` (Daffan/the-barn-challenge); worlds: Perille et al. 2020, arXiv:2008.13315.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from lme.errors import InputError, argument_error, nearest, require
from lme.inputs.resources import resource_dir
from lme.types import Floats, Pose
from lme.worlds.barn.files import find_worlds
from lme.worlds.barn.generator import CELL_M, ORIGIN_X_M, ORIGIN_Y_M, official_recipes
from lme.worlds.barn.layouts import Layout, fresh_layout, hard_layout, official_layout, published_layout
from lme.worlds.barn.path import OPTIMAL_SPEED_M_S, benchmark_length
from lme.worlds.rules import MOST_WORLDS, TaskRules, check_chosen, check_numbers
from lme.worlds.world import Task, World

FRESH = ("fresh", "fresh_hard")  # subsets that are generated; the others are official worlds
FRESH_KEYS = ("count", "fresh_seed")  # keys that only these subsets use
TARGET = "lme.worlds.barn.Barn"  # of the map set, in its YAML
AHEAD_M = 10.0  # of the start, along y, is the goal of run.py
FIRST_FRESH = 1000  # number of the first fresh world, so that records never mix them with official ones


@cache
def lab100() -> tuple[int, ...]:
    """The hundred worlds of a test script of the paper's lab, sorted; `maps/README.md` has the source.

    That the paper's "100 challenging maps" are the same is inferred.
    """
    with (resource_dir("maps") / "barn" / "lab100.csv").open(newline="", encoding="utf-8") as file:
        return tuple(sorted(int(row["world"]) for row in csv.DictReader(file)))


OFFICIAL: dict[str, Callable[[], Iterable[int]]] = {
    "all": lambda: range(300),
    "official50": lambda: range(0, 300, 6),
    "lab100": lab100,
    "hard100": lambda: range(200, 300),
}
SUBSETS = (*OFFICIAL, *FRESH)


def is_idle(key: str, map_set: Mapping[str, Any]) -> bool:
    """Return whether a key of a map set's config is for fresh worlds, and the subset is one of official worlds."""
    return key in FRESH_KEYS and map_set.get("_target_") == TARGET and map_set.get("subset") in OFFICIAL


def check_given(keys: Iterable[str], map_set: Mapping[str, Any], node: str = "map") -> None:
    """Raise InputError if one of the keys that the user gave is idle. node: the map set's key in the whole config."""
    for key in keys:
        if is_idle(key, map_set):
            choose = f"; {node}.worlds=0-9 chooses worlds" if key == "count" else ""
            raise InputError(
                f"{node}.{key} is {map_set[key]} with {node}.subset={map_set['subset']}: "
                f"must be left out, or {node}.subset be {' or '.join(FRESH)}{choose}"
            )


@dataclass(slots=True)
class BarnConfig(TaskRules):
    """Keys of `conf/map/barn.yaml`."""

    subset: str
    source: str | None
    count: int
    fresh_seed: int
    start: list[float]
    goal: list[float] | None
    time_limit: float

    def __post_init__(self) -> None:
        TaskRules.__post_init__(self)  # super() fails in a dataclass with slots
        if self.subset not in SUBSETS:
            raise argument_error(
                f"subset is {self.subset!r}: {nearest(self.subset, SUBSETS)}must be one of {', '.join(SUBSETS)}"
            )
        if self.subset in FRESH and self.source is not None:
            raise argument_error(
                f"source is {self.source}: must be null with subset={self.subset}, which is generated"
            )
        require("count", self.count, at_least=1, at_most=MOST_WORLDS)
        require("fresh_seed", self.fresh_seed, at_least=0)
        check_numbers("start", self.start, (3,), "three finite numbers: x, y [m], yaw [rad]")
        if self.goal is not None:
            check_numbers("goal", self.goal, (2,), "two finite numbers: x, y [m]")


class Barn:
    """BARN worlds by their official numbers; fresh worlds count from 1000."""

    Config = BarnConfig

    def __init__(self, config: BarnConfig) -> None:
        """Choose the worlds; `task` reads the files. Raises InputError if a requested world does not exist."""
        self.config = config
        self._start = Pose(*config.start)
        x, y, _ = self._start
        self._goal: Floats = np.array(
            [x, y + AHEAD_M] if config.goal is None else config.goal, dtype=np.float64
        )
        self._files = None if config.source is None else find_worlds(config.source)
        self.numbers = config.numbers(self._subset())
        absent = [number for number in self.numbers if not self._exists(number)]
        if absent:
            raise argument_error(self._describe_missing(absent))

    def task(self, number: int) -> Task:
        """Build world `number`. Raises InputError for a broken published file.

        Its measures are cylinders, fill, the five of difficulty, and the recipe's smoothings if the recipe is known.
        """
        layout = self.layout(number)
        start, goal = self._start, self._goal
        measures = {"cylinders": float(len(layout.cylinders)), "fill": layout.fill}
        if layout.recipe is not None:
            measures["smoothings"] = float(layout.recipe.smoothings)
        return self.config.task(
            "barn",
            number,
            World(circles=layout.cylinders),
            start,
            goal,
            length=benchmark_length(layout.path, start, goal),
            speed=OPTIMAL_SPEED_M_S,
            measures=measures | layout.measures(),
        )

    def way(self, number: int) -> Floats:
        """(P, 2) the benchmark's path through world `number` with start and goal [m].

        It leads through the middles of its cells; the scripts that score measure it (−0.15, −0.10) m off them.
        """
        cells = self.layout(number).path * CELL_M + np.array([ORIGIN_X_M, ORIGIN_Y_M])
        return np.vstack([self._start[:2], cells, self._goal])

    def layout(self, number: int) -> Layout:
        """Cylinders, grid, the benchmark's path and the recipe of world `number`."""
        check_chosen(number, self.numbers, "world", "barn")
        if self._files is not None:
            return published_layout(number, self._files[number])
        if self.config.subset in FRESH:
            generate = hard_layout if self.config.subset == "fresh_hard" else fresh_layout
            return generate(self.config.fresh_seed, number - FIRST_FRESH)
        return official_layout(number)

    def _subset(self) -> Iterable[int]:
        config = self.config
        if config.subset in FRESH:
            return range(FIRST_FRESH, FIRST_FRESH + config.count)
        if self._files is not None and config.subset == "all":
            return self._files
        return OFFICIAL[config.subset]()

    def _exists(self, number: int) -> bool:
        if self._files is not None:
            return number in self._files
        return number >= FIRST_FRESH if self.config.subset in FRESH else number in official_recipes()

    def _describe_missing(self, absent: list[int]) -> str:
        config = self.config
        listing = ", ".join(map(str, absent[:5])) + (
            f" and {len(absent) - 5} more" if len(absent) > 5 else ""
        )
        if self._files is not None:
            key = f"subset is {config.subset!r}" if config.worlds is None else "worlds"
            return f"{key} asks for worlds that source {config.source} does not hold: {listing}"
        right = f"from {FIRST_FRESH} on with subset={config.subset}" if config.subset in FRESH else "0 to 299"
        return f"worlds asks for {listing}: must be {right}"
