"""The user's own map: a room from a file, optionally with a given start and goal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError
from lme.types import Floats, Pose
from lme.worlds.room import Room, RoomConfig
from lme.worlds.sampling import Configuration


@dataclass(slots=True)
class MapFileConfig(RoomConfig):
    """Keys of `conf/map/file.yaml`."""

    start: list[float] | None = None  # x, y [m], and optionally yaw [rad]; None: drawn for each number
    goal: list[float] | None = None  # x, y [m]; None: drawn for each number

    def __post_init__(self) -> None:
        RoomConfig.__post_init__(self)  # super() fails in a dataclass with slots
        _check_numbers("map.start", self.start, (2, 3), "[x, y] or [x, y, yaw] in metres and radians")
        _check_numbers("map.goal", self.goal, (2,), "[x, y] in metres")
        if self.start is not None and self.goal is not None:
            _check_single(self.worlds, "map.start and map.goal")


class MapFile(Room):
    """A room whose start, goal or both are given; the rest is drawn for each number, as in a room.

    The config gives them, or else the file. With both given there is one configuration, number 0. A start without a
    yaw faces the goal.
    """

    Config = MapFileConfig
    config: MapFileConfig

    def _start(self) -> Sequence[float] | None:
        return self._plan.start if self.config.start is None else self.config.start

    def _goal(self) -> Sequence[float] | None:
        return self._plan.goal if self.config.goal is None else self.config.goal

    def _available_numbers(self) -> range:
        if self._start() is None or self._goal() is None:
            return super()._available_numbers()
        _check_single(self.config.worlds, "the start and the goal of the file")
        return range(1)

    def _configuration(self, number: int) -> Configuration:
        start, goal = self._start(), self._goal()
        for key, point in (("start", start), ("goal", goal)):
            if point is not None:
                self._space.check_free(f"map.{key}", point)
        if start is not None:
            return self._from_given_start(start, number)
        if goal is not None:
            return self._to_given_goal(np.array(goal), number)
        return super()._configuration(number)

    def _from_given_start(self, start: Sequence[float], number: int) -> Configuration:
        """Configuration from the given start to the given goal, or to a drawn one."""
        position, given_goal = np.array(start[:2]), self._goal()
        if given_goal is None:
            goal = self._space.draw_partner(self._rng(number), position, self.config.min_distance)
        else:
            goal = np.array(given_goal)
        yaw = start[2] if len(start) == 3 else math.atan2(goal[1] - position[1], goal[0] - position[0])
        return Configuration(Pose(start[0], start[1], yaw), goal)

    def _to_given_goal(self, goal: Floats, number: int) -> Configuration:
        """Configuration from a drawn start, with any yaw, to the given goal."""
        rng = self._rng(number)
        x, y = self._space.draw_partner(rng, goal, self.config.min_distance).tolist()
        return Configuration(Pose(x, y, rng.uniform(-math.pi, math.pi)), goal)


def _check_single(worlds: list[int] | None, keys: str) -> None:
    """Raise InputError if worlds other than the only one that `keys` leaves, number 0, are chosen."""
    if worlds not in (None, [0]):
        raise InputError(
            f"map.worlds is {worlds}: must be null or [0], since {keys} together leave one configuration"
        )


def _check_numbers(key: str, values: list[float] | None, counts: tuple[int, ...], right: str) -> None:
    if values is not None and (len(values) not in counts or not all(map(math.isfinite, values))):
        raise InputError(f"{key} is {list(values)}: must be {right}, or null")
