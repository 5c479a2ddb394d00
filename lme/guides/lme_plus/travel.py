"""Expected time to the target from places around the robot, around all known points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.guides.lme_plus.learned_times import LearnedTimes
from lme.guides.lme_plus.travel_grid import Grid, SpeedProfile, descend, workspace
from lme.guides.lme_plus.travel_time import travel_times
from lme.robots import Robot
from lme.types import Bools, Floats, Pose

BEYOND = 1.0  # [s] ways that take longer than the best by more than this are not searched
_CELL = 0.15  # [m] side of a cell
NARROW = 100.0  # [-] factor of the time at v_max in a passage that leaves less than the margin
_STRIDE = 3  # cells between two places on the way of steepest descent
_WINDING = 4.0  # [-] greatest length of a way that is followed in the grid, in multiples of the reach
_NOBODY = np.empty((0, 6))
_LEAST_BAND = 0.05  # [m] of slower driving near obstacles, however wide the robot


@dataclass(slots=True)
class TravelConfig:
    """The speed near obstacles, and how people count."""

    comfort: float
    slowdown: float
    patience: float
    personal_space: float

    def __post_init__(self) -> None:
        require("comfort", self.comfort, above=0.0)
        require("slowdown", self.slowdown, at_least=0.0)
        require("patience", self.patience, at_least=0.0)
        require("personal_space", self.personal_space, at_least=0.0)


class Field(NamedTuple):
    """Expected times T of a grid's cells [s], and that of the robot, which was at `here`. here, target: (2,) [m].

    narrow: whether each cell is in a passage that leaves less than the margin, row by row with the grid's frame, as
    in `times`.
    """

    times: Floats
    narrow: Bools
    robot_time: float
    grid: Grid
    here: Floats
    target: Floats
    v_max: float

    def kept(self) -> Field:
        """Return a copy with times of its own, which stay when the next field is computed."""
        return self._replace(times=self.times.copy(), narrow=self.narrow.copy())

    def descent(self, pose: Pose, length: float) -> tuple[Floats, float]:
        """Places on the fastest way from `pose`, for `length` [m], in the frame at it: (K, 2).

        Also returns how far ahead the way becomes narrow [m], inf if nowhere.
        """
        grid = (*self.grid,)
        descent: tuple[Floats, float] = descend(self.times, self.narrow, (*pose,), grid, length, _STRIDE)
        return descent


class Travel:
    """Solver for expected times within about `reach` [m] of a robot, for one robot at a time."""

    def __init__(
        self, config: TravelConfig, robot: Robot, reach: float, margin: float, narrow: bool = True
    ) -> None:
        """margin: distance that passages leave on each side [m]; narrow: those that leave less are not closed."""
        inner = robot.footprint.inscribed_radius + margin
        tight = robot.footprint.inscribed_radius if narrow else inner
        comfort = max(robot.footprint.inscribed_radius + config.comfort, inner + _LEAST_BAND)
        room = robot.footprint.circumscribed_radius + _CELL
        self._reach = reach
        self._berth, self._patience = inner + config.personal_space, config.patience
        self._pace = SpeedProfile(robot.v_max, tight, inner, comfort, config.slowdown, NARROW, room)
        self._size = math.ceil(2.0 * reach / _CELL) + 1
        self._workspace = workspace(self._size, _CELL, comfort)

    def field(
        self,
        points: Floats,
        target: Floats,
        position: Floats,
        people: Floats = _NOBODY,
        learned: LearnedTimes | None = None,
        narrow: float = NARROW,
        stuck: Floats = _NOBODY,
    ) -> Field:
        """Compute the field of a robot at `position` (2,) to its `target` (2,), among `points` (M, 2).

        It is valid until the next call. people (P, 6): x, y, vx, vy and radius of people who are not among the
        points, in the same frame [m, m/s], and how long they have stood [s]. learned: times that earlier fields gave
        to the places at the edge; those of this field are added, unless there are people, who will be elsewhere
        later. narrow: factor of the time at v_max in narrow passages. stuck (S, 6): places that take longer,
        `StuckPlaces.rows`. Where people and such places overlap, the longest time counts.
        """
        # A grid of whole cells around the robot; people and stuck places form one crowd.
        x, y = (math.floor((coordinate - self._reach) / _CELL) * _CELL for coordinate in position.tolist())
        grid = Grid(x, y, _CELL, self._size)
        learned = LearnedTimes() if learned is None else learned
        pace = (*self._pace._replace(narrow=narrow),)
        crowd = self._crowd(people)
        crowd = np.concatenate((crowd, stuck)) if len(stuck) else crowd
        scene = points, target, position, (*grid,), pace, crowd, *learned.around(grid)
        inputs = (*self._workspace,), *scene, BEYOND
        # Search, and again with ways that leave the grid if it has no good one to a target in it.
        work, ends = self._workspace, (grid, position, target, self._pace.v_max)
        field = Field(work.times, work.narrow, travel_times(*inputs, False), *ends)
        if self._is_detour(field):  # perhaps there is a better way around outside the grid
            field = Field(work.times, work.narrow, travel_times(*inputs, True), *ends)
        time = field.robot_time
        if math.isfinite(time) and not len(people):
            learned.learn(field.times, grid, position, target, time + BEYOND, field.v_max)
        return field

    def _is_detour(self, field: Field) -> bool:
        """Return whether the grid has no way, or only a narrow one, to a target that is in it."""
        if apart(field.here, field.target) > self._reach:
            return False
        x, y = field.here.tolist()
        _, ahead = field.descent(Pose(x, y, 0.0), _WINDING * self._reach)
        return math.isinf(field.robot_time) or math.isfinite(ahead)

    def _crowd(self, people: Floats) -> Floats:
        """Convert people to the form that `travel_times` takes: (P, 6)."""
        if not len(people):
            return _NOBODY
        reach = people[:, 4] + self._berth
        speed = np.hypot(people[:, 2], people[:, 3])
        # People are expected to stand for as long again as they have stood.
        leave_time = np.maximum(people[:, 5], self._patience)
        wait = np.minimum(2.0 * reach / np.maximum(speed, 1e-9), leave_time)
        return np.column_stack((people[:, :4], reach, wait / (2.0 * reach)))


def apart(a: Floats, b: Floats) -> float:
    """Distance between two points (2,) [m], by Python's numbers: a fifth of the time of NumPy's."""
    return math.dist(a.tolist(), b.tolist())
