"""DRL-DCLP: a local planner learned by reinforcement for any rectangular robot and any limits."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from lme.errors import InputError, require
from lme.planners.commands import limited
from lme.planners.dclp.network import Network, draw
from lme.planners.dclp.observation import DIRECTIONS, nearest_by_direction
from lme.planners.dclp.weights import read_weights
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation, Twist

# What the network was trained for: the authors' training script. Half widths are at most (front + rear) / 2.
_TRAINED = {
    "v_max": (0.3, 2.0),
    "omega_max": (math.pi / 6, 2 * math.pi),
    "alpha_v": (0.5, 5.0),
    "alpha_omega": (math.pi / 6, 2 * math.pi),
    "front": (0.075, 0.6),
    "rear": (0.075, 0.6),
    "half_width": (0.075, 0.6),
}
_ROUNDING = 1e-6


@dataclass(slots=True)
class Told:
    """The robot as the network is told, where that differs from the robot; null: the robot's own."""

    v_max: float | None = None  # [m/s]
    omega_max: float | None = None  # [rad/s]
    alpha_v: float | None = None  # [m/s²]
    alpha_omega: float | None = None  # [rad/s²]
    front: float | None = None  # [m] from the base to the front
    rear: float | None = None  # [m] from the base to the rear
    half_width: float | None = None  # [m]
    lidar_x: float | None = None  # [m] of the lidar ahead of the base

    def __post_init__(self) -> None:
        for key in _TRAINED:
            if getattr(self, key) is not None:
                require(f"planner.told.{key}", getattr(self, key), above=0.0)
        if self.lidar_x is not None:
            require("planner.told.lidar_x", self.lidar_x)

    def over(self, robot: Robot) -> Told:
        """The robot's own values with these in place of them."""
        half_length, half_width, rounding = robot.footprint.box
        length, width = half_length + rounding, half_width + rounding
        own = Told(*robot.limits, front=length, rear=length, half_width=width, lidar_x=robot.lidar.x)
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        return Told(**{name: getattr(own, name) if value is None else value for name, value in given.items()})


@dataclass(slots=True)
class DclpConfig:
    """The network's weights and the ranges that it is given where the lidar sees nothing."""

    weights: str | None = None  # path of an .npz
    no_return: float = 5.0  # [m] range of a beam without return
    blind_range: float = 5.0  # [m] range in a direction without beams
    lookahead: float = 2.0  # [m] of the subgoal on a guide's path
    full_v: float | None = None  # [m/s] command of a full answer of the network; None: v_max as told
    full_omega: float | None = None  # [rad/s] the same for omega_max
    told: Told = field(default_factory=Told)

    def __post_init__(self) -> None:
        for key in ("no_return", "blind_range", "lookahead"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in ("full_v", "full_omega"):
            if getattr(self, key) is not None:
                require(f"planner.{key}", getattr(self, key), above=0.0)


class Dclp:
    """DRL-DCLP (Zhang et al. 2025, RA-L, DOI 10.1109/LRA.2025.3544927), the network alone.

    Network, observation and action are those of the authors' code. The network may drive in reverse. It knows no
    arrival. The command is limited to what the robot can reach in a period. Along a guide's path the subgoal is
    the first point at least `lookahead` away.
    """

    Config = DclpConfig

    def __init__(self, config: DclpConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._network = Network(_weights(config.weights))
        told = config.told.over(robot)
        _warn_if_untrained(told)
        self._mount = robot.lidar.mount._replace(x=_number(told.lidar_x))
        sizes = [_number(told.front), _number(told.rear), _number(told.half_width)]
        self._directions = np.empty((DIRECTIONS, 6))
        self._directions[:, 3:] = sizes

    def reset(self, rng: np.random.Generator) -> None:
        """Take the random numbers that the mixture's components are drawn with."""
        self._rng = rng

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Command for one control period."""
        config = self._config
        self._directions[:, :3] = nearest_by_direction(
            observation.scan, self._mount, config.no_return, config.blind_range
        )
        x, y = self._goal(guidance)
        limits = self._limits(observation.limits)
        state = np.array([math.hypot(x, y), math.atan2(y, x), *observation.twist, *limits])
        v, omega = draw(self._network.mixture(self._directions, state), self._rng)
        full_v = limits.v_max if config.full_v is None else config.full_v
        full_omega = limits.omega_max if config.full_omega is None else config.full_omega
        return limited(float(v) * full_v, float(omega) * full_omega, observation, self._dt)

    def _goal(self, guidance: Guidance) -> Floats:
        """The subgoal, or where the guide has a path, the first point on it that is `lookahead` away: (2,) [m]."""
        path = guidance.path
        if path is None or guidance.blocked:
            return guidance.subgoal
        far = np.flatnonzero(np.hypot(path[:, 0], path[:, 1]) >= self._config.lookahead)
        goal: Floats = path[far[0] if len(far) else -1]
        return goal

    def _limits(self, own: Limits) -> Limits:
        """The limits that the network is told."""
        told = self._config.told
        given = {name: getattr(told, name) for name in Limits._fields}
        return own._replace(**{name: value for name, value in given.items() if value is not None})


def _weights(path: str | None) -> dict[str, np.typing.NDArray[np.float32]]:
    if path is None:
        raise InputError(
            "planner.weights is null: no DCLP network ships with lme; import the authors' checkpoint with "
            "`lme weights import dclp PATH NAME`, then give planner.weights=NAME"
        )
    return read_weights(Path(path))


def _number(value: float | None) -> float:
    assert value is not None
    return float(value)


def _warn_if_untrained(told: Told) -> None:
    for key, (low, high) in _TRAINED.items():
        value = _number(getattr(told, key))
        if not low - _ROUNDING <= value <= high + _ROUNDING:
            warnings.warn(
                f"planner.told.{key} is {value:g}: the published DCLP network was trained for {low:.3g} to {high:.3g}",
                stacklevel=3,
            )
