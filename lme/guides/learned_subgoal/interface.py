"""Interface between a robot and its subgoal network: the network's inputs, and the subgoal of its choice."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.geometry.straight_ways import straight_ways
from lme.guides.learned_subgoal.candidates import BEARINGS, RANGES, bearings, candidates
from lme.guides.learned_subgoal.kernels import nearest_by_sector
from lme.guides.learned_subgoal.weights import REPORTED
from lme.guides.lme.maintenance import carried
from lme.perception.dead_reckoning import DeadReckoning
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation

REACH = 5.0  # [m] farther returns count as this far
_TARGET = 10.0  # [m] farther targets count as this far
_LIMITS = (2.0, 4.0, 20.0, 25.0)  # limits of a robot that are 1 for the network: Jackal's
_EDGE = 1e-6  # [rad] a bearing on the edge of the field of view is in it, whatever the rounding
_ROUNDING = 1e-4  # of a bound, which a file holds as float32


@dataclass(slots=True)
class LearnedSubgoalConfig:
    """The network's weights, how long a subgoal is kept, and when a candidate is free."""

    weights: str | None
    period: float
    margin: float
    turn_margin: float

    def __post_init__(self) -> None:
        require("period", self.period, above=0.0)
        for key in ("margin", "turn_margin"):
            require(key, getattr(self, key), at_least=0.0)


class SubgoalFeatures(NamedTuple):
    """Inputs of the network, in the order of its signature.

    scan (BEARINGS,): nearest return about each bearing, 1 for `REACH` or none. free (CANDIDATES,): 1 for candidates to
    which the robot can turn and drive straight, 0 for others. state (STATE_INPUTS,): distance, cos and sin of the
    target; v, ω; the limits; the last subgoal.
    """

    scan: Floats
    free: Floats
    state: Floats


class SubgoalInterface:
    """Inputs of the network for a robot, and the subgoal of its last choice.

    steps: control periods between two choices.
    """

    def __init__(self, config: LearnedSubgoalConfig, robot: Robot) -> None:
        self._config, self._dt = config, robot.dt
        self._mount, self._box = robot.lidar.mount, robot.footprint.box
        self._candidates = candidates()
        off_centre = np.abs(np.remainder(bearings() - robot.lidar.yaw + math.pi, math.tau) - math.pi)
        self._in_view = np.repeat(off_centre <= robot.lidar.fov / 2 + _EDGE, len(RANGES))
        self.steps = max(round(config.period * robot.control_rate), 1)
        self.clear()

    def clear(self) -> None:
        """Start a new episode."""
        self._subgoal: Floats = np.zeros((1, 2))
        self._reckoning = DeadReckoning(self._dt)
        self._new = self._blocked = False

    def features(self, observation: Observation, target: Floats) -> SubgoalFeatures:
        """Return the inputs of the network. target: (2,) in the robot frame [m].

        If no candidate is free, all of them count as free.
        """
        self._follow(observation)
        config = self._config
        points = obstacle_points(observation.scan, self._mount)
        ways = straight_ways(self._candidates, points, self._box, config.margin, config.turn_margin)
        free = ways & self._in_view
        self._blocked = not free.any()
        if self._blocked:
            free = np.ones_like(free)
        scan = nearest_by_sector(points, BEARINGS, REACH) / REACH
        return SubgoalFeatures(scan, free.astype(np.float64), self._state(observation, target))

    def choose(self, index: int) -> None:
        """Take a candidate as the subgoal, in the control period of the last `features`."""
        self._subgoal, self._new = self._candidates[index : index + 1], True

    def guidance(self, observation: Observation) -> Guidance:
        """Return the subgoal. Call it once per control period, after `choose` if that was called."""
        new, self._new = self._new, False
        if not new:
            self._follow(observation)
        return Guidance(self._subgoal[0].copy(), None, new, self._blocked)

    def _follow(self, observation: Observation) -> None:
        """Keep the subgoal in place while the robot moves on."""
        move = self._reckoning.move(observation)
        if move is not None:
            self._subgoal = carried(self._subgoal, move, self._dt)

    def _state(self, observation: Observation, target: Floats) -> Floats:
        x, y = target.tolist()
        away, bearing = math.hypot(x, y), math.atan2(y, x)
        limits: Limits = observation.limits
        v, omega = observation.twist
        shares = [value / unit for value, unit in zip(limits.bounds, _LIMITS, strict=True)]
        twist = [v / limits.v_max, omega / limits.omega_max]
        last = (self._subgoal[0] / RANGES[-1]).tolist()
        here = [min(away, _TARGET) / _TARGET, math.cos(bearing), math.sin(bearing)]
        return np.array([*here, *twist, *shares, *last])


def reported_values(robot: Robot) -> Floats:
    """Values of `REPORTED` for a robot: (6,)."""
    half_length, half_width, rounding = robot.footprint.box
    return np.array([*robot.limits.bounds, 2 * (half_length + rounding), 2 * (half_width + rounding)])


def warn_if_untrained(robot: Robot, trained: Floats) -> None:
    """Warn if the network was not trained for such a robot.

    trained: (6, 2), lowest and highest values of `REPORTED`.
    """
    for key, value, (low, high) in zip(REPORTED, reported_values(robot), trained, strict=True):
        if not low - _ROUNDING <= value <= high + _ROUNDING:
            span = f"{low:.3g} to {high:.3g}" if low < high else f"{low:.3g}"
            warnings.warn(
                f"robot has {key} {value:g}: this subgoal network was trained for {span}", stacklevel=4
            )
