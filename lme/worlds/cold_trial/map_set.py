"""The cold trial as a map set: a robot, disturbances and a task for every number, fixed by the seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from lme.errors import InputError, require
from lme.robots import Robot
from lme.worlds.check import check_task
from lme.worlds.cold_trial.families import DYNABARN, STATIC, Place, check_paths, families, task_in
from lme.worlds.cold_trial.ranges import TrialRanges, columns_of, drawn_disturbances, drawn_robot
from lme.worlds.rules import LEAST_TIME, MOST_WORLDS, TIME_FACTOR, check_chosen, fair_limit
from lme.worlds.world import DrawnTask, Task

NAME = "cold_trial"
ROBOT = "drawn"  # the name of every robot
ATTEMPTS = 100  # robots drawn for a world, before it counts as too narrow for the ranges


@dataclass(slots=True)
class ColdTrialConfig:
    """Keys of `conf/map/_cold_trial.yaml`."""

    subset: str = STATIC  # static | dynabarn
    trial_seed: int = 0  # seed of everything that is drawn
    count: int = 500  # numbers 0, 1, …
    worlds: list[int] | None = None  # numbers to drive instead of all
    paths: list[str] | None = (
        None  # ROS maps of buildings (.yaml), or folders of them; None: generated floor plans
    )
    passage_margin: float = 0.05  # [m] by which a path is wider on each side than the footprint's inner disc
    start_margin: float = 0.05  # [m] free around the footprint's outer disc at start and goal
    time_factor: float = TIME_FACTOR  # time limit, as a multiple of the time for the shortest path at v_max
    least_time: float = LEAST_TIME  # [s] shortest time limit
    ranges: TrialRanges = field(default_factory=TrialRanges)

    def __post_init__(self) -> None:
        if self.subset not in (STATIC, DYNABARN):
            raise InputError(f"map.subset is {self.subset!r}: must be {STATIC} or {DYNABARN}")
        require("map.trial_seed", self.trial_seed, at_least=0)
        require("map.count", self.count, at_least=1, at_most=MOST_WORLDS)
        require("map.passage_margin", self.passage_margin, at_least=0.0)
        require("map.start_margin", self.start_margin, at_least=0.0)
        require("map.time_factor", self.time_factor, at_least=1.0)
        require("map.least_time", self.least_time, above=0.0)
        chosen = self.worlds
        if chosen is not None and not (chosen and set(chosen) <= set(range(self.count))):
            raise InputError(
                f"map.worlds is {list(chosen)}: must be numbers from 0 to {self.count - 1}, at least one, or null"
            )
        if self.paths is not None:
            check_paths(self.paths)


class ColdTrial:
    """Episodes by number. Number k does not depend on which others are chosen, nor on the system.

    The families take turns, so that any run of numbers has as many of each.
    """

    Config = ColdTrialConfig

    def __init__(self, config: ColdTrialConfig) -> None:
        self.config = config
        self._families = families(config.subset, config.paths)
        self._numbers = tuple(range(config.count) if config.worlds is None else config.worlds)
        self._kept: Callable[[int], DrawnTask] = lru_cache(maxsize=8)(self._draw)

    @property
    def name(self) -> str:
        """What the records call this map."""
        return NAME

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the chosen episodes."""
        return self._numbers

    def task(self, number: int) -> Task:
        """The task of episode `number`, for its own robot. Raises InputError as `drawn` does."""
        return self.drawn(number).task

    def drawn(self, number: int) -> DrawnTask:
        """Robot, disturbances and task of episode `number`.

        Raises InputError for a number that was not chosen, and if no robot of the ranges fits into the world.
        """
        check_chosen(number, self._numbers, "episode", NAME)
        return self._kept(number)

    def _draw(self, number: int) -> DrawnTask:
        """First the world and the disturbances, then robots until one fits into the world."""
        config = self.config
        rng = np.random.default_rng(np.random.SeedSequence([config.trial_seed, number]))
        family = self._families[number % len(self._families)]
        seed, choice = rng.integers(2**31, size=2).tolist()
        disturbances = drawn_disturbances(config.ranges, rng)
        for redrawn in range(ATTEMPTS):
            robot = drawn_robot(ROBOT, config.ranges, rng)
            try:
                task = self._task(number, family, seed, choice, robot)
            except InputError as error:
                narrow = error
                continue
            columns = {
                "family": family,
                **columns_of(robot, disturbances),
                "robots_redrawn": float(redrawn),
            }
            return DrawnTask(task, robot, disturbances, columns)
        raise InputError(
            f"map {NAME}, episode {number} ({family}): none of {ATTEMPTS} robots of map.ranges fits ({narrow})"
        )

    def _task(self, number: int, family: str, seed: int, choice: int, robot: Robot) -> Task:
        """The family's task with the trial's rules. Raises InputError if the robot does not fit into the world."""
        config, shape = self.config, robot.footprint
        radius = shape.r_min + config.passage_margin
        margin = max(0.0, shape.r_max + config.start_margin - radius)
        task = task_in(family, Place(seed, choice, radius, margin, tuple(config.paths or ())))
        check_task(task, robot)
        fastest = task.shortest_path_length / robot.v_max
        return replace(
            task,
            map_name=NAME,
            number=number,
            robot=ROBOT,
            time_limit=fair_limit(fastest, config.time_factor, config.least_time),
            optimal_time=fastest,
        )
