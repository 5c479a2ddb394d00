"""Artificial potential field: attraction by the subgoal, repulsion by scan points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.kernels.potential import repulsion
from lme.planners.commands import approach
from lme.planners.stopping import StoppingGuard
from lme.robots import Robot
from lme.sensing.blind_arc import BlindArc
from lme.types import Floats, Guidance, Observation, Twist

_CLOSEST = 0.01  # [m] below this clearance the repulsion is constant


@dataclass(slots=True)
class ApfConfig:
    """Settings; `conf/planner/apf.yaml` gives their sources."""

    attraction: float = 5.0  # k_p [N/m]
    conic_beyond: float = 1.0  # [m]
    repulsion: float = 0.01  # η [N·m³]
    influence: float = 0.5  # ρ_0 [m]
    spread: float = math.radians(20.0)  # [rad]
    turn_gain: float = 4.0  # [1/s]
    margin: float = 0.01  # [m]

    def __post_init__(self) -> None:
        for key in ("attraction", "conic_beyond", "influence", "turn_gain"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        require("planner.spread", self.spread, above=0.0, at_most=math.pi)
        for key in ("repulsion", "margin"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)


class Apf:
    """Artificial potential field (Khatib 1986, DOI 10.1177/027836498600500106).

    Attraction ½·k_p·d² with constant force beyond `conic_beyond`, which is equivalent to the paper's speed limit.
    Repulsion ½·η·(1/ρ − 1/ρ_0)² (FIRAS) for the clearance ρ between a scan point and a disc of the robot's
    collision radius, shared among neighbours in bearing (`lme.kernels.potential`). The robot turns towards the
    force; its speed is proportional to the force's component ahead, v_max under the full attraction. Points
    remembered in the lidar's blind arc also repel. A `StoppingGuard` slows commands that are not safe.
    """

    Config = ApfConfig

    def __init__(self, config: ApfConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._mount = robot.lidar.mount
        self._radius = robot.r
        self._guard = StoppingGuard(robot, config.margin)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the remembered points."""
        self._blind = BlindArc(self._mount, self._radius + self._config.influence)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Command for one control period."""
        points = self._blind.points(observation)
        force = self._force(guidance.subgoal, points)
        distance = math.hypot(*guidance.subgoal)
        return self._guard.guard(self._follow(force, distance, observation), observation, points)

    def _force(self, subgoal: Floats, points: Floats) -> tuple[float, float]:
        """Negative gradient of the potential, relative to the greatest attraction: (x, y)."""
        config = self._config
        x, y = map(float, subgoal)
        pull = 1.0 / max(math.hypot(x, y), config.conic_beyond)
        push = config.repulsion / (config.attraction * config.conic_beyond)
        along, across = repulsion(points, self._radius, config.influence, _CLOSEST, config.spread)
        return pull * x + push * along, pull * y + push * across

    def _follow(self, force: tuple[float, float], distance: float, observation: Observation) -> Twist:
        """Turn towards the force, with a speed proportional to its component ahead."""
        limits, now = observation.limits, observation.twist
        bearing = math.atan2(force[1], force[0])
        fastest = approach(bearing, now.omega, limits.omega_max, limits.alpha_omega, self._dt)
        gentle = self._config.turn_gain * bearing
        omega = min(fastest, gentle) if bearing > 0.0 else max(fastest, gentle)
        v_max = limits.v_max * min(max(force[0], 0.0), 1.0)
        return Twist(approach(distance, now.v, v_max, limits.alpha_v, self._dt), omega)
