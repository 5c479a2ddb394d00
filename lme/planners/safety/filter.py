"""Filter around any planner, after whose commands the robot can still stop before everything seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.inputs.plausibility import check_fields
from lme.inputs.returned import checked_command
from lme.perception.scan_points import BlindArc
from lme.planners.commands import limited
from lme.planners.safety.check import STILL, TOUCHING, StoppingCheck, StoppingState
from lme.robots import Robot
from lme.types import Guidance, Observation, Planner, Twist

_REACH, _CELL = 1.5, 0.02  # [m] of the memory of the blind arc, whose points are at most half a cell off


@dataclass(slots=True)
class SafetyFilterConfig:
    """Margin that the filter keeps free, and the delay of commands."""

    margin: float
    latency: float
    lag: float

    def __post_init__(self) -> None:
        for key in ("margin", "latency", "lag"):
            require(key, getattr(self, key), at_least=0.0)
        check_fields(self)


class SafetyFilter:
    """Planner that sends another planner's command if the robot can stop after it, else the nearest such command.

    If there is none, it brakes. A robot that is nearer to a point than `margin`, or cannot stop farther from it, must
    not come nearer. The points are those that the guide knows, else those of the scan and of a memory of the lidar's
    blind arc. The outline is the collision footprint.
    """

    Config = SafetyFilterConfig

    def __init__(self, config: SafetyFilterConfig, planner: Planner, robot: Robot) -> None:
        self.planner = planner
        self._margin = max(config.margin, TOUCHING)
        self._dt = robot.dt
        self._check = StoppingCheck(robot.footprint, robot.dt, config.latency, config.lag)
        self._mount = robot.lidar.mount
        self._blind = BlindArc(self._mount, _REACH, _CELL)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` is the planner's."""
        self._check.reset()
        self._blind = BlindArc(self._mount, _REACH, _CELL)
        self.planner.reset(rng)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period. Raises InputError if the planner's is not two finite numbers."""
        points = self._blind.points(observation) if guidance.points is None else guidance.points
        v, omega = checked_command(self.planner.plan(observation, guidance), self.planner)
        command = limited(v, omega, observation, self._dt)
        # Replace the command if the robot could not stop after it, and keep to the limits again.
        check, margin, state = self._check, self._margin, StoppingState.of(observation, points)
        if check.clearance(command, state, margin) < margin:
            braking_clearance = (
                check.clearance(STILL, state, margin) - TOUCHING
            )  # distance that braking keeps
            command = check.nearest(command, state, max(braking_clearance, TOUCHING)) or STILL
            command = limited(*command, observation, self._dt)
        check.sent(command)
        return command
