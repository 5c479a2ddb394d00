"""DRL-DCLP: a local planner trained by reinforcement learning for any rectangular robot and any limits."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lme.errors import config_key, require
from lme.inputs.onnx_file import SignedNetwork, warn_if_untrained
from lme.inputs.resources import resource_dir
from lme.planners.commands import limited
from lme.planners.dclp.observation import nearest_by_direction
from lme.planners.dclp.weights import COMPONENTS, DIRECTION_INPUTS, DIRECTIONS, REPORTED, SIGNATURE
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation, Twist

SHIPPED = "dclp_jackal.onnx"  # in conf/network/; lme learn made it


@dataclass(slots=True)
class ReportedLimits:
    """The robot as described to the network, where that differs from the robot; null: the robot's own value."""

    v_max: float | None
    omega_max: float | None
    alpha_v: float | None
    alpha_omega: float | None
    front: float | None
    rear: float | None
    half_width: float | None
    lidar_x: float | None

    def __post_init__(self) -> None:
        for key in REPORTED:
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)
        if self.lidar_x is not None:
            require("lidar_x", self.lidar_x)

    def filled_from(self, robot: Robot) -> ReportedLimits:
        """Return these values, with the robot's own in place of nulls."""
        half_length, half_width, rounding = robot.footprint.box
        length, width = half_length + rounding, half_width + rounding
        own = ReportedLimits(
            *robot.limits.bounds, front=length, rear=length, half_width=width, lidar_x=robot.lidar.x
        )
        return replace(own, **{name: value for name, value in asdict(self).items() if value is not None})


@dataclass(slots=True)
class DclpConfig:
    """Weights of the network, and the ranges that it gets where the lidar sees nothing."""

    weights: str | None
    no_return: float
    blind_range: float
    lookahead: float
    goal_within: float | None
    full_v: float | None
    full_omega: float | None
    reported_limits: ReportedLimits

    def __post_init__(self) -> None:
        for key in ("no_return", "blind_range", "lookahead"):
            require(key, getattr(self, key), above=0.0)
        for key in ("goal_within", "full_v", "full_omega"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)


class DclpFeatures(NamedTuple):
    """Inputs of the network, in the order of its signature.

    directions: (90, 6) of cos, sin, distance [m], length ahead, length behind, half width [m]. state: (8,) of distance
    and bearing of the target, v, ω, and the limits of v, ω and their accelerations, in SI units.
    """

    directions: Floats
    state: Floats


class DclpInterface:
    """Inputs of the network for a robot, and the command for its output."""

    def __init__(self, config: DclpConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self.reported_limits = reported = config.reported_limits.filled_from(robot)
        self._mount = robot.lidar.mount._replace(x=_number(reported.lidar_x))
        self._directions = np.empty((DIRECTIONS, DIRECTION_INPUTS))
        sizes = (reported.front, reported.rear, reported.half_width)
        self._directions[:, 3:] = [_number(size) for size in sizes]

    def features(self, observation: Observation, subgoal: Floats) -> DclpFeatures:
        """Return the inputs of the network. subgoal: (2,) in the robot frame [m]."""
        config = self._config
        directions = self._directions.copy()
        directions[:, :3] = nearest_by_direction(
            observation.scan, self._mount, config.no_return, config.blind_range
        )
        x, y = subgoal
        limits = self._limits(observation.limits)
        state = np.array([math.hypot(x, y), math.atan2(y, x), *observation.twist, *limits.bounds])
        return DclpFeatures(directions, state)

    def goal(self, guidance: Guidance) -> Floats:
        """Return the subgoal or, if the guide has a path, its first point that is `lookahead` away: (2,) [m].

        It is the end of the path if no point is so far away, or if the end is less than `goal_within` ahead or behind.
        """
        path, within = guidance.path, self._config.goal_within
        if path is None or guidance.blocked:
            return guidance.subgoal
        far = np.flatnonzero(np.hypot(path[:, 0], path[:, 1]) >= self._config.lookahead)
        is_near = within is not None and path[-1, 0] < within
        goal: Floats = path[far[0] if len(far) and not is_near else -1]
        return goal

    def action(self, command: Twist, observation: Observation) -> Floats:
        """Return the output (2,) that corresponds to a command, clipped to ±1."""
        answer: Floats = np.clip(np.array(command) / self.full(observation.limits), -1.0, 1.0)
        return answer

    def command(self, action: Floats, observation: Observation) -> Twist:
        """Return the command for an output (2,), v and ω in (−1, 1), limited to what is reachable in a period."""
        v, omega = action
        full_v, full_omega = self.full(observation.limits)
        return limited(float(v) * full_v, float(omega) * full_omega, observation, self._dt)

    def full(self, own: Limits) -> tuple[float, float]:
        """Return the commands for a full output [m/s], [rad/s]. own: the robot's limits."""
        config, limits = self._config, self._limits(own)
        return (
            limits.v_max if config.full_v is None else config.full_v,
            limits.omega_max if config.full_omega is None else config.full_omega,
        )

    def _limits(self, own: Limits) -> Limits:
        """Limits that the network is given."""
        reported = self._config.reported_limits
        given = {name: getattr(reported, name, None) for name in Limits._fields}
        return own._replace(**{name: value for name, value in given.items() if value is not None})


def _number(value: float | None) -> float:
    assert value is not None
    return float(value)


def reported_values(reported: ReportedLimits) -> Floats:
    """Return the values of `REPORTED` for a robot as described to the network: (7,)."""
    return np.array([_number(getattr(reported, key)) for key in REPORTED])


class Mixture(NamedTuple):
    """Gaussian components of the action. logits: (4,); means: (4, 2) in (−1, 1), of v and ω."""

    logits: Floats
    means: Floats


def draw(mixture: Mixture, rng: np.random.Generator) -> Floats:
    """Draw a component by its probability and return its mean: (2,) of v and ω in (−1, 1).

    The authors' deterministic policy draws the component, too, and omits only the noise about its mean.
    """
    odds = np.exp(mixture.logits - mixture.logits.max())
    odds = np.cumsum(odds)
    chosen = int(np.searchsorted(odds, rng.random() * odds[-1], side="right"))
    means: Floats = mixture.means[min(chosen, COMPONENTS - 1)]
    return means


class Dclp:
    """DRL-DCLP (Zhang et al. 2025, RA-L, DOI 10.1109/LRA.2025.3544927), the network alone.

    Network, observation and action are those of the authors' code. The network may drive in reverse. It has no
    notion of arrival. The command is limited to what the robot can reach in a period. Along a guide's path the
    subgoal is the first point at least `lookahead` away, or the end of the path once that is less than `goal_within`
    ahead.
    """

    Config = DclpConfig

    def __init__(self, config: DclpConfig, robot: Robot) -> None:
        shipped = resource_dir("conf") / "network" / SHIPPED
        self._network = SignedNetwork(shipped if config.weights is None else Path(config.weights), SIGNATURE)
        self.interface = DclpInterface(config, robot)
        self.seen: DclpFeatures | None = None  # inputs of the network at the last step
        said = [f"{config_key(f'reported_limits.{key}')} is" for key in REPORTED]
        reported = reported_values(self.interface.reported_limits)
        warn_if_untrained(said, reported, self._network.trained, "DCLP")

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode with the generator that draws the mixture's components."""
        self._rng = rng

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        self.seen = self.interface.features(observation, self.interface.goal(guidance))
        return self.interface.command(
            draw(Mixture(*self._network.answer(*self.seen)), self._rng), observation
        )
