"""Expected time to the target from places around the robot, around all known points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.policies.distance import distances_to
from lme.policies.lme_plus.kernels.travel_time import Grid, Pace, descend, times_at, travel_times
from lme.robots import Robot
from lme.types import Floats

BEYOND = 0.5  # [s] ways that take longer than the best by more than this are not searched
_EVERY = 3  # cells between two places on the way of steepest descent
_LEAST_BAND = 0.05  # [m] of slower driving near obstacles, however wide the robot


@dataclass(slots=True)
class TravelConfig:
    """The grid on which times are found, and the speed near obstacles."""

    cell: float = 0.15  # [m] side of a cell
    comfort: float = 0.345  # [m] from the outline; with obstacles farther away the robot drives at v_max
    slowdown: float = 2.0  # [-] in the narrowest passage it takes 1 + this times as long

    def __post_init__(self) -> None:
        require("guide.travel.cell", self.cell, above=0.0)
        require("guide.travel.comfort", self.comfort, above=0.0)
        require("guide.travel.slowdown", self.slowdown, at_least=0.0)


class Field(NamedTuple):
    """Expected times T of the cells of a grid [s], and the robot's. `here`, `target`: positions (2,) [m]."""

    times: Floats
    robot_time: float
    grid: Grid
    here: Floats
    target: Floats
    v_max: float

    def rest(self, places: Floats) -> Floats:
        """T at (N, 2) places [s]: (N,). Where the search did not go, the least time that it allows.

        If the robot has no way to the target, such places have the time of the straight line to it.
        """
        times = times_at(self.times, places, self.grid)
        if math.isfinite(self.robot_time):
            least = np.maximum(self.robot_time + BEYOND - distances_to(places, self.here) / self.v_max, 0.0)
        else:
            least = distances_to(places, self.target) / self.v_max
        return np.where(np.isfinite(times), times, least)

    def descent(self, length: float) -> Floats:
        """Places on the robot's fastest way, for `length` [m]: (K, 2)."""
        return descend(self.times, self.here, self.grid, length, _EVERY)


def expected_times(
    points: Floats,
    target: Floats,
    here: Floats,
    reach: float,
    robot: Robot,
    margin: float,
    config: TravelConfig,
) -> Field:
    """The field within about `reach` [m] of a robot at `here` (2,), among `points` (M, 2), to its `target` (2,).

    All are in one frame [m]. margin: distance that passages must leave on each side [m].
    """
    corner = np.floor((here - reach) / config.cell) * config.cell
    grid = Grid(float(corner[0]), float(corner[1]), config.cell, math.ceil(2.0 * reach / config.cell) + 1)
    inner = robot.footprint.r_min + margin
    comfort = max(robot.footprint.r_min + config.comfort, inner + _LEAST_BAND)
    pace = Pace(robot.v_max, inner, comfort, config.slowdown, robot.footprint.r_max + config.cell)
    times, robot_time = travel_times(points, target, here, grid, pace, BEYOND, False)
    if not math.isfinite(robot_time):  # enclosed on the grid: perhaps there is a way around outside it
        times, robot_time = travel_times(points, target, here, grid, pace, BEYOND, True)
    return Field(times, robot_time, grid, here, target, robot.v_max)
