"""Training episodes: the world and the robot of each, the reward of a step, and the result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError, require
from lme.gym.kernels.steps import COLLISION, RUNNING, SUCCESS, TIMEOUT
from lme.metrics import barn_metric
from lme.robots import Robot
from lme.types import Floats, Ints, Outcome
from lme.worlds.check import check_task
from lme.worlds.world import MapSet, Task

WORLDS_KEPT = 4096  # built tasks; a BARN world takes 10 kB

OUTCOMES = {SUCCESS: Outcome.SUCCESS, COLLISION: Outcome.COLLISION, TIMEOUT: Outcome.TIMEOUT}
CODES: dict[Outcome | None, int] = {None: RUNNING} | {outcome: code for code, outcome in OUTCOMES.items()}

_NAMES = np.array(["", *map(str, OUTCOMES.values())], dtype=object)  # by code

DrawRobot = Callable[[np.random.Generator], Robot]


class Episodes:
    """Draws episodes from a map set, for one robot or for robots that a function draws.

    Each world is built when it is first drawn, and kept: a fresh BARN world takes tens of milliseconds to find. Drawn
    robots all have the same lidar and control rate. `robot` is the one drawn with seed 0.
    """

    def __init__(self, map_set: MapSet, robot: Robot | DrawRobot) -> None:
        self._map_set = map_set
        self._draw_robot = None if isinstance(robot, Robot) else robot
        self.robot = robot if isinstance(robot, Robot) else robot(np.random.default_rng(0))
        self._task = lru_cache(maxsize=WORLDS_KEPT)(self._built)

    def draw(self, rng: np.random.Generator, world: int | None = None) -> tuple[Task, Robot]:
        """Return task and robot of the next episode, in this world or in one drawn uniformly by `rng`.

        Raises InputError for a world that the map set does not hold, or in which the robot cannot drive.
        """
        numbers = self._map_set.numbers
        number = numbers[int(rng.integers(len(numbers)))] if world is None else world
        robot = self.robot if self._draw_robot is None else self._checked(self._draw_robot(rng))
        return self._task(number), robot

    def _built(self, number: int) -> Task:
        if number not in self._map_set.numbers:
            raise InputError(f"world is {number!r}: must be one of {_summary(self._map_set.numbers)}")
        task = self._map_set.task(number)
        if self._draw_robot is None:
            check_task(task, self.robot)
        return task

    def _checked(self, robot: Robot) -> Robot:
        for key in ("lidar", "control_rate"):
            if getattr(robot, key) != getattr(self.robot, key):
                raise InputError(
                    f"{key} of a randomly drawn robot is {getattr(robot, key)}: must be the same for all, here "
                    f"{getattr(self.robot, key)}"
                )
        return robot


def world_of(options: Mapping[str, Any] | None) -> int | None:
    """Return the world chosen by the options of Gymnasium's `reset`, if any. Raises InputError for other options."""
    for key in options or {}:
        if key != "world":
            raise InputError(f"options has {key!r}: may hold only 'world', the number of a world")
    return (options or {}).get("world")


def _summary(numbers: tuple[int, ...]) -> str:
    """Numbers of some of the worlds, for an error message."""
    if len(numbers) <= 8:
        return ", ".join(map(str, numbers))
    return f"the {len(numbers)} worlds {numbers[0]}, {numbers[1]}, …, {numbers[-1]}"


@dataclass(slots=True)
class Reward:
    """Terms of the reward. The defaults are those of ros_jackal: progress, +20 for arrival, −1 for a collision."""

    progress: float = 1.0  # [1/m] per metre that the robot came nearer to the goal, in a straight line
    success: float = 20.0  # at arrival
    collision: float = -1.0  # at contact
    timeout: float = 0.0  # at the time limit
    step: float = 0.0  # at every step

    def __post_init__(self) -> None:
        for key in ("progress", "success", "collision", "timeout", "step"):
            require(key, getattr(self, key))

    def of(self, previous: Floats, current: Floats, outcomes: Ints) -> Floats:
        """Rewards (N,). previous, current (N,): distances to the goal [m]; outcomes (N,): of `lme.gym.kernels`."""
        ends = np.array([0.0, self.success, self.collision, self.timeout])
        return self.progress * (previous - current) + (self.step + ends[outcomes])


class Result(NamedTuple):
    """Result of an episode. time: on the task's clock [s]; path_length [m]; optimal_time: the task's [s]."""

    outcome: Outcome
    world: int
    time: float
    path_length: float
    steps: int
    optimal_time: float

    def info(self) -> dict[str, Any]:
        """Return the entries of Gymnasium's info at an episode's end; `is_success` is Stable-Baselines3's name."""
        success = self.outcome is Outcome.SUCCESS
        metric = (
            math.nan if math.isnan(self.optimal_time) else barn_metric(success, self.time, self.optimal_time)
        )
        return {
            "outcome": str(self.outcome),
            "is_success": success,
            "barn_metric": metric,
            "optimal_time": self.optimal_time,
            "time": self.time,
            "path_length": self.path_length,
            "steps": self.steps,
            "world": self.world,
        }


@dataclass(slots=True)
class Results:
    """Results of K episodes: arrays (K,) of the fields of `Result`, outcomes as codes. `results[k]` is one of them."""

    outcomes: Ints
    worlds: Ints
    times: Floats
    lengths: Floats
    steps: Ints
    optimal_times: Floats

    def __len__(self) -> int:
        return len(self.outcomes)

    def __getitem__(self, k: int) -> Result:
        columns = (self.worlds, self.times, self.lengths, self.steps, self.optimal_times)
        return Result(OUTCOMES[int(self.outcomes[k])], *(column[k].item() for column in columns))

    def infos(self) -> dict[str, NDArray[Any]]:
        """Return the entries of `Result.info` as arrays (K,)."""
        success, times, optimal = self.outcomes == SUCCESS, self.times, self.optimal_times
        if (optimal <= 0.0).any():
            self[int(np.argmax(optimal <= 0.0))].info()  # says so
        metrics = np.where(success, optimal / np.clip(times, 2 * optimal, 8 * optimal), 0.0)
        return {
            "outcome": _NAMES[self.outcomes],
            "is_success": success,
            "barn_metric": np.where(np.isnan(optimal), np.nan, metrics),
            "optimal_time": optimal,
            "time": times,
            "path_length": self.lengths,
            "steps": self.steps,
            "world": self.worlds,
        }


def distances(goals: Floats, positions: NDArray[np.float64]) -> Floats:
    """Distances (N,) from positions (N, 2) to goals (N, 2) [m]."""
    return np.hypot(goals[:, 0] - positions[:, 0], goals[:, 1] - positions[:, 1])
