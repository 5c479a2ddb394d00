"""Training episodes, each with a world and a robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from lme.errors import InputError
from lme.robots import Robot
from lme.worlds.check import check_task
from lme.worlds.world import MapSet, Task

WORLDS_KEPT = 4096  # built tasks; a BARN world takes 10 kB

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
