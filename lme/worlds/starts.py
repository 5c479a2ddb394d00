"""One map and one goal, with a different start for every number: the base of traps and scenes."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.types import Floats, Pose
from lme.worlds.rules import MOST_WORLDS, PacedRules, check_chosen, path_measures
from lme.worlds.sampling import FreeSpace
from lme.worlds.world import Task, World

STAGE_RADIUS = 0.2  # [m] of the paper's robot (§IV.A)

Place = Callable[[int], tuple[World, FreeSpace]]  # from a number to the world and its free space


@dataclass(slots=True)
class StartsConfig(PacedRules):
    """Keys that `conf/map/traps.yaml` and `conf/map/_scene.yaml` have in common."""

    starts: int
    start_seed: int
    lateral: float
    turn: float
    radius: float | None
    grid: float

    def __post_init__(self) -> None:
        PacedRules.__post_init__(self)  # super() fails in a dataclass with slots
        require("starts", self.starts, at_least=1, at_most=MOST_WORLDS)
        require("start_seed", self.start_seed, at_least=0)
        require("lateral", self.lateral, at_least=0.0, at_most=0.5)
        require("turn", self.turn, at_least=0.0, at_most=math.pi)
        if self.radius is not None:
            require("radius", self.radius, above=0.0, at_most=0.5)
        require("grid", self.grid, above=0.0)


class Starts:
    """The same task from a different start for every number. Start n does not depend on which others are chosen."""

    def __init__(
        self, name: str, config: StartsConfig, make_world: Place, start: Floats, goal: Floats
    ) -> None:
        """Choose the starts.

        name: name of the map in its tasks. start, goal: (2,) [m]; starts are drawn around `start`.
        """
        self.config = config
        self._name, self._make_world = name, make_world
        self._start, self._goal = start, goal
        self.numbers = config.numbers(range(config.starts))

    def task(self, number: int) -> Task:
        """Build the task from start `number`; its shortest path is computed once.

        Raises InputError for a number that was not chosen, for a start at the goal, for a start or goal that is
        not in free space, or if no path between them is wide enough.
        """
        check_chosen(number, self.numbers, "start", self._name)
        start = drawn_start(self._start, self._goal, self.config, number)
        straight = math.dist(start[:2], self._goal)
        world, space = self._make_world(number)
        length = space.checked_length(f"map {self._name}, start {number}", start, self._goal)
        return self.config.task(
            self._name,
            number,
            world,
            start,
            self._goal.copy(),
            length=length,
            speed=self.config.pace,
            measures=path_measures(length, straight),
        )


def drawn_start(start: Floats, goal: Floats, config: StartsConfig, number: int) -> Pose:
    """Draw start `number`: `start` (2,) moved sideways off its line to `goal` (2,) [m], heading near the goal."""
    rng = np.random.default_rng([config.start_seed, number])
    offset, turn = rng.uniform(-1.0, 1.0, 2).tolist()
    ahead = math.atan2(goal[1] - start[1], goal[0] - start[0])
    step = offset * config.lateral
    x, y = start[0] - step * math.sin(ahead), start[1] + step * math.cos(ahead)
    return Pose(float(x), float(y), ahead + turn * config.turn)
