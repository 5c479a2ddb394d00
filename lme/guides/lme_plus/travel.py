"""Expected time to the target from places around the robot, around all known points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.guides.lme_plus.learned_times import LearnedTimes
from lme.guides.lme_plus.travel_grid import Grid, Pace, descend, rest_at, workspace
from lme.guides.lme_plus.travel_time import travel_times
from lme.robots import Robot
from lme.types import Bools, Floats, Pose

BEYOND = 1.0  # [s] ways that take longer than the best by more than this are not searched
_CELL = 0.15  # [m] side of a cell
NARROW = 100.0  # [-] times as long as at v_max it takes in a passage that leaves less than the margin
_EVERY = 3  # cells between two places on the way of steepest descent
_WINDING = 4.0  # times the reach: as far as a way in the grid is followed
_ITSELF = Pose(0.0, 0.0, 0.0)  # of the field's frame
_NOBODY = np.empty((0, 6))
_LEAST_BAND = 0.05  # [m] of slower driving near obstacles, however wide the robot


@dataclass(slots=True)
class TravelConfig:
    """The speed near obstacles, and how people count."""

    comfort: float = 0.345  # [m] from the outline; with obstacles farther away the robot drives at v_max
    slowdown: float = 2.0  # [-] in a passage that just leaves the margin it takes 1 + this times as long
    patience: float = (
        10.0  # [s] for which who stands is expected to stay; for longer if they have stood so far
    )
    personal_space: float = 0.4  # [m] from the outline of people, where it takes time to wait for them

    def __post_init__(self) -> None:
        require("guide.travel.comfort", self.comfort, above=0.0)
        require("guide.travel.slowdown", self.slowdown, at_least=0.0)
        require("guide.travel.patience", self.patience, at_least=0.0)
        require("guide.travel.personal_space", self.personal_space, at_least=0.0)


class Field(NamedTuple):
    """Expected times T of the cells of a grid [s], and the robot's, which was `here`. here, target: (2,) [m].

    narrow: which of the cells are in a passage that leaves less than the margin, row by row with the grid's frame, as
    in `times`.
    """

    times: Floats
    narrow: Bools
    robot_time: float
    grid: Grid
    here: Floats
    target: Floats
    v_max: float

    def rest(self, places: Floats, pose: Pose = _ITSELF) -> Floats:
        """T at (N, 2) places in the frame at `pose` [s]: (N,). Where the search did not go, the least time it allows.

        If the robot has no way to the target, such places have the time of the straight line to it.
        """
        frame, grid = (*pose,), (*self.grid,)  # plain tuples, which Numba recognises faster
        ends = self.robot_time, BEYOND, self.here, self.target, self.v_max
        found: Floats = rest_at(self.times, places, frame, grid, *ends)
        return found

    def kept(self) -> Field:
        """The same with times of its own, which stay when the next field is found."""
        return self._replace(times=self.times.copy(), narrow=self.narrow.copy())

    def descent(self, pose: Pose, length: float) -> tuple[Floats, float]:
        """Places on the fastest way from `pose`, for `length` [m], in the frame at it: (K, 2).

        Returns also how far ahead the way gets narrow [m]; inf: nowhere.
        """
        grid = (*self.grid,)
        found: tuple[Floats, float] = descend(self.times, self.narrow, (*pose,), grid, length, _EVERY)
        return found


class Travel:
    """Finds expected times within about `reach` [m] of a robot, for one robot at a time."""

    def __init__(
        self, config: TravelConfig, robot: Robot, reach: float, margin: float, narrow: bool = True
    ) -> None:
        """margin: distance that passages leave on each side [m]; narrow: those that leave less are not closed."""
        inner = robot.footprint.r_min + margin
        tight = robot.footprint.r_min if narrow else inner
        comfort = max(robot.footprint.r_min + config.comfort, inner + _LEAST_BAND)
        room = robot.footprint.r_max + _CELL
        self._reach = reach
        self._berth, self._patience = inner + config.personal_space, config.patience
        self._pace = Pace(robot.v_max, tight, inner, comfort, config.slowdown, NARROW, room)
        self._size = math.ceil(2.0 * reach / _CELL) + 1
        self._workspace = workspace(self._size, _CELL, comfort)

    def field(
        self,
        points: Floats,
        target: Floats,
        here: Floats,
        people: Floats = _NOBODY,
        learned: LearnedTimes | None = None,
        narrow: float = NARROW,
        stuck: Floats = _NOBODY,
    ) -> Field:
        """The field of a robot at `here` (2,), among `points` (M, 2), to its `target` (2,), valid until the next call.

        people (P, 6): x, y, vx, vy and radius of those who are no points, in the same frame [m, m/s], and for how long
        they stand [s]. learned: what earlier fields said of the places at the edge; this one's times are added, unless
        there are people, who will not be there later. narrow: times as long as at v_max it takes in narrow passages.
        stuck (S, 6): places that take longer, `StuckPlaces.rows`. Of people and such places at one place the longest
        time counts.
        """
        x, y = (math.floor((at - self._reach) / _CELL) * _CELL for at in here.tolist())
        grid = Grid(x, y, _CELL, self._size)
        learned = LearnedTimes() if learned is None else learned
        pace = (*self._pace._replace(narrow=narrow),)
        crowd = self._crowd(people)
        crowd = np.concatenate((crowd, stuck)) if len(stuck) else crowd
        scene = points, target, here, (*grid,), pace, crowd, *learned.around(grid)
        given = (*self._workspace,), *scene, BEYOND
        work, places = self._workspace, (grid, here, target, self._pace.v_max)
        field = Field(work.times, work.narrow, travel_times(*given, False), *places)
        if self._is_no_good(field):  # perhaps there is a better way around outside the grid
            field = Field(work.times, work.narrow, travel_times(*given, True), *places)
        time = field.robot_time
        if math.isfinite(time) and not len(people):
            learned.learn(field.times, grid, here, target, time + BEYOND, field.v_max)
        return field

    def _is_no_good(self, field: Field) -> bool:
        """Whether the grid has no way, or only a narrow one, to a target that is in it."""
        if apart(field.here, field.target) > self._reach:
            return False
        x, y = field.here.tolist()
        _, ahead = field.descent(Pose(x, y, 0.0), _WINDING * self._reach)
        return math.isinf(field.robot_time) or math.isfinite(ahead)

    def _crowd(self, people: Floats) -> Floats:
        """People as `travel_times` takes them: (P, 6)."""
        if not len(people):
            return _NOBODY
        reach = people[:, 4] + self._berth
        speed = np.hypot(people[:, 2], people[:, 3])
        leaves = np.maximum(
            people[:, 5], self._patience
        )  # who has stood for long will stand for as long again
        wait = np.minimum(2.0 * reach / np.maximum(speed, 1e-9), leaves)
        return np.column_stack((people[:, :4], reach, wait / (2.0 * reach)))


def apart(a: Floats, b: Floats) -> float:
    """Distance of two points (2,) [m]; of Python's numbers, which take a fifth of the time of numpy's."""
    return math.dist(a.tolist(), b.tolist())
