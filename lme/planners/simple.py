"""The paper's own local planner: turn towards the subgoal, then drive (Algorithm 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.planners.commands import approach
from lme.robots import Robot, towards
from lme.types import Guidance, Observation, Twist


@dataclass(slots=True)
class SimpleConfig:
    """Gains and accelerations that the paper leaves open, and the heading tolerance."""

    heading_tolerance: float
    pd_below: float
    kp: float
    kd: float
    alpha_v: float | None
    alpha_omega: float | None

    def __post_init__(self) -> None:
        for key in ("heading_tolerance", "pd_below", "kp", "kd"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("alpha_v", "alpha_omega"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)


class Simple:
    """Two independent acceleration-limited controllers (paper §III.E).

    Their accelerations are the config's, at most the robot's. Out of the heading tolerance the command is 0
    (Algorithm 3), so there the robot brakes as hard as it can.
    """

    Config = SimpleConfig

    def __init__(self, config: SimpleConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._alpha_v = math.inf if config.alpha_v is None else config.alpha_v
        self._alpha_omega = math.inf if config.alpha_omega is None else config.alpha_omega

    def reset(self, rng: np.random.Generator) -> None:
        """Do nothing: there is no state."""

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        x, y = guidance.subgoal.tolist()
        bearing = math.atan2(y, x)
        v, omega = observation.ramp_start
        limits = observation.limits
        if abs(bearing) < self._config.heading_tolerance:
            alpha_v = min(self._alpha_v, limits.alpha_v)
            v_rate = approach(math.hypot(x, y), v, limits.v_max, alpha_v, self._dt)
        else:
            v_rate = towards(0.0, v, limits.alpha_v, self._dt)
        alpha_omega = min(self._alpha_omega, limits.alpha_omega)
        return Twist(v_rate, self._turn(bearing, omega, limits.omega_max, alpha_omega))

    def _turn(self, bearing: float, omega: float, omega_max: float, alpha: float) -> float:
        """Acceleration-limited turn rate; PD control at small errors, never too fast to stop at the bearing."""
        limit = approach(bearing, omega, omega_max, alpha, self._dt)
        if abs(bearing) >= self._config.pd_below:
            return limit
        desired = self._config.kp * bearing - self._config.kd * omega
        return towards(min(desired, limit) if bearing > 0 else max(desired, limit), omega, alpha, self._dt)
