"""Generated buildings as a map set: a different building, start and goal for every number."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lme.errors import argument_error, require
from lme.types import Floats, Pose
from lme.worlds.indoor.kinds import corridors, floor_plans, offices
from lme.worlds.indoor.layouts import CELL_M, Building
from lme.worlds.rules import MOST_WORLDS, PacedRules, check_chosen, path_measures
from lme.worlds.sampling import Configuration, FreeSpace
from lme.worlds.starts import STAGE_RADIUS
from lme.worlds.world import Task, World

KINDS: dict[str, Callable[[np.random.Generator, int], Building]] = {
    "corridors": corridors,
    "offices": offices,
    "floor_plan": floor_plans,
}
PAIRS_TRIED = 200  # of start and goal, before the distance counts as impossible


@dataclass(slots=True)
class IndoorConfig(PacedRules):
    """Keys of `conf/map/indoor.yaml`."""

    kind: str
    count: int
    building_seed: int
    min_distance: float
    max_distance: float
    radius: float | None
    passage_margin: float
    margin: float
    grid: float

    def __post_init__(self) -> None:
        PacedRules.__post_init__(self)  # super() fails in a dataclass with slots
        if self.kind not in KINDS:
            raise argument_error(f"kind is {self.kind!r}: must be one of {', '.join(KINDS)}")
        require("count", self.count, at_least=1, at_most=MOST_WORLDS)
        for key in ("building_seed", "min_distance", "margin"):
            require(key, getattr(self, key), at_least=0.0)
        require("max_distance", self.max_distance, at_least=self.min_distance)
        if self.radius is not None:
            require("radius", self.radius, above=0.0, at_most=0.45)
        require("grid", self.grid, above=0.0)
        require("passage_margin", self.passage_margin, at_least=2 * self.grid, at_most=0.5)


class Indoor:
    """Worlds by number. World n does not depend on which others are chosen."""

    Config = IndoorConfig

    def __init__(self, config: IndoorConfig) -> None:
        self.config = config
        self._name = f"indoor_{config.kind}"
        self.numbers = config.numbers(range(config.count))

    def task(self, number: int) -> Task:
        """Build world `number`; its building and its shortest path are computed once.

        Raises InputError for a number that was not chosen, and for distances that start and goal cannot have.
        """
        check_chosen(number, self.numbers, "world", self._name)
        config = self.config
        radius = STAGE_RADIUS if config.radius is None else config.radius
        stream = (config.building_seed, list(KINDS).index(config.kind), number)
        distances = (config.min_distance, config.max_distance)
        site = _site(
            stream, config.kind, radius, config.passage_margin, config.margin, config.grid, distances
        )
        straight = math.dist(site.start[:2], site.goal)
        return config.task(
            self._name,
            number,
            site.world,
            site.start,
            site.goal.copy(),
            length=site.length,
            speed=config.pace,
            measures=path_measures(site.length, straight),
        )


class _Site(NamedTuple):
    """A building with a start, a goal (2,) and the length of the shortest path between them [m]."""

    world: World
    start: Pose
    goal: Floats
    length: float


@lru_cache(maxsize=256)
def _site(
    stream: tuple[int, ...],
    kind: str,
    radius: float,
    passage_margin: float,
    margin: float,
    grid: float,
    distances: tuple[float, float],
) -> _Site:
    """Draw the world of a random stream, once per process."""
    rng = np.random.default_rng(stream)
    building = KINDS[kind](rng, math.ceil((2 * radius + passage_margin) / CELL_M - 1e-9))
    plan = building.floor_plan()
    space = FreeSpace(plan, grid, radius, margin)
    start, goal = _start_and_goal(rng, building, space, distances)
    return _Site(plan.world, start, goal, space.path_length(start, goal))


def _start_and_goal(
    rng: np.random.Generator, building: Building, space: FreeSpace, distances: tuple[float, float]
) -> Configuration:
    """Draw a start and a goal in different rooms, at these least and greatest distances [m].

    Raises InputError if there are none.
    """
    min_distance, max_distance = distances
    for _ in range(PAIRS_TRIED):
        configuration = space.draw(rng, min_distance)
        ends = np.array(configuration.start[:2]), configuration.goal
        together = any(all(map(room.holds, ends)) for room in building.rooms)
        if not together and math.dist(*ends) <= max_distance:
            return configuration
    raise argument_error(
        f"max_distance is {max_distance:g} m: must be a distance that start and goal can have in different rooms "
        f"of each building (min_distance is {min_distance:g} m)"
    )
