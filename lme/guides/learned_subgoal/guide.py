"""A guide whose subgoals come from a network, and its interface: the network's inputs, and what its choice means."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.errors import require
from lme.geometry.straight_ways import straight_ways
from lme.guides.learned_subgoal.network import (
    BEARINGS,
    RANGES,
    REPORTED,
    SIGNATURE,
    bearings,
    candidates,
    draw,
)
from lme.guides.lme.maintenance import carried
from lme.inputs.onnx_file import SignedNetwork, warn_if_untrained
from lme.inputs.resources import resource_dir
from lme.perception.dead_reckoning import DeadReckoning
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation

SHIPPED = "learned_subgoal.onnx"  # `lme learn experiment=learn/learned_subgoal` made it
REACH = 5.0  # [m] farther returns count as this far
_TARGET = 10.0  # [m] farther targets count as this far
_LIMITS = (2.0, 4.0, 20.0, 25.0)  # limits of a robot that are 1 for the network: Jackal's
_EDGE = 1e-6  # [rad] a bearing on the edge of the field of view is in it, whatever the rounding


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


class LearnedSubgoal:
    """Hierarchical reinforcement learning with intermediate targets: the upper level, for any planner.

    Once per `period`, a network trained by PPO gives a probability to each candidate of a polar grid around the robot
    to which a straight way is free, and one is drawn. In between, the subgoal stays in place.
    """

    Config = LearnedSubgoalConfig

    def __init__(self, config: LearnedSubgoalConfig, robot: Robot) -> None:
        shipped = resource_dir("conf") / "network" / SHIPPED
        self._network = SignedNetwork(shipped if config.weights is None else Path(config.weights), SIGNATURE)
        self._interface = SubgoalInterface(config, robot)
        self._left = 0
        said = [f"robot has {key}" for key in REPORTED]
        warn_if_untrained(said, reported_values(robot), self._network.trained, "subgoal")

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self._rng, self._left = rng, 0
        self._interface.clear()

    def guide(self, observation: Observation) -> Guidance:
        """Return the subgoal chosen now or in one of the last control periods."""
        if self._left == 0:
            seen = self._interface.features(observation, observation.target)
            (logits,) = self._network.answer(*seen)
            self._interface.choose(draw(logits, self._rng))
            self._left = self._interface.steps
        self._left -= 1
        return self._interface.guidance(observation)


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


@njit(cache=True, error_model="numpy")
def nearest_by_sector(points: Floats, sectors: int, reach: float) -> Floats:
    """Distance of the nearest point in each sector, `reach` if there is none nearer [m]: (sectors,).

    points (M, 2) in the robot frame [m]. Sector 0 is centred straight ahead, the others follow counter-clockwise.
    """
    found = np.full(sectors, reach)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        k = math.floor(math.atan2(y, x) / math.tau * sectors + 0.5) % sectors
        found[k] = min(found[k], math.hypot(x, y))
    return found


def reported_values(robot: Robot) -> Floats:
    """Values of `REPORTED` for a robot: (6,)."""
    half_length, half_width, rounding = robot.footprint.box
    return np.array([*robot.limits.bounds, 2 * (half_length + rounding), 2 * (half_width + rounding)])
