"""Artificial potential field: attraction by the subgoal, repulsion by scan points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lme.errors import require
from lme.perception.scan_points import BlindArc
from lme.planners.commands import StoppingGuard, approach
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

_CLOSEST = 0.01  # [m] below this clearance the repulsion is constant


@dataclass(slots=True)
class ApfConfig:
    """Settings; `conf/planner/apf.yaml` gives their sources."""

    attraction: float
    conic_beyond: float
    repulsion: float
    influence: float
    spread: float
    turn_gain: float
    margin: float

    def __post_init__(self) -> None:
        for key in ("attraction", "conic_beyond", "influence", "turn_gain"):
            require(key, getattr(self, key), above=0.0)
        require("spread", self.spread, above=0.0, at_most=math.pi)
        for key in ("repulsion", "margin"):
            require(key, getattr(self, key), at_least=0.0)


class Apf:
    """Artificial potential field (Khatib 1986, DOI 10.1177/027836498600500106).

    Attraction ½·k_p·d² with constant force beyond `conic_beyond`, which is equivalent to the paper's speed limit.
    Repulsion ½·η·(1/ρ − 1/ρ_0)² (FIRAS) for the clearance ρ between a scan point and a disc of the robot's
    collision radius, shared among neighbours in bearing (`repulsion`). The robot turns towards the
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
        """Return the command for one control period."""
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
        limits, twist = observation.limits, observation.ramp_start
        bearing = math.atan2(force[1], force[0])
        fastest = approach(bearing, twist.omega, limits.omega_max, limits.alpha_omega, self._dt)
        gentle = self._config.turn_gain * bearing
        omega = min(fastest, gentle) if bearing > 0.0 else max(fastest, gentle)
        v_max = limits.v_max * min(max(force[0], 0.0), 1.0)
        return Twist(approach(distance, twist.v, v_max, limits.alpha_v, self._dt), omega)


@njit(cache=True, error_model="numpy")
def repulsion(
    points: Floats, radius: float, influence: float, closest: float, spread: float
) -> tuple[float, float]:
    """Force of the scan points on a disc for a gain η of 1, in the robot frame [1/m³]: (x, y).

    points (M, 2), radius of the disc [m]. A point at clearance ρ pushes directly away from itself with the gradient
    of FIRAS (Khatib 1986), (1/ρ − 1/influence) / ρ². The force is 0 beyond `influence` [m] and constant below
    `closest` [m]. A point's push is divided among the points within `spread` [rad] of its bearing, which count less
    if they are farther away or weaker. A post therefore counts as one obstacle, and a wall as one for every `spread`
    of its width, at any lidar resolution.
    """
    bearings, pushes, normals = _nearby(points, radius, influence, closest)
    crowds = _crowds(bearings, pushes, spread)
    along, across = 0.0, 0.0
    # Negative gradient: each point pushes against its own direction, by its share of the crowd.
    for i in range(len(pushes)):
        push = pushes[i] / crowds[i]
        along -= push * normals[i, 0]
        across -= push * normals[i, 1]
    return along, across


@njit(cache=True, error_model="numpy")
def _nearby(points: Floats, radius: float, influence: float, closest: float) -> tuple[Floats, Floats, Floats]:
    """Bearings, pushes and directions of the points within the influence, sorted by bearing."""
    bearings, pushes = np.empty(len(points)), np.empty(len(points))
    normals = np.empty((len(points), 2))
    count = 0
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        distance = max(math.sqrt(x * x + y * y), 1e-12)
        clearance = max(distance - radius, closest)
        if clearance >= influence:
            continue
        normals[count, 0], normals[count, 1] = x / distance, y / distance
        bearings[count] = math.atan2(y, x)
        # Gradient of the FIRAS potential: (1/ρ − 1/ρ₀) / ρ², with ρ₀ the influence.
        pushes[count] = (1.0 / clearance - 1.0 / influence) / (clearance * clearance)
        count += 1
    # `_crowds` needs the points in the order of their bearings.
    order = np.argsort(bearings[:count])
    return bearings[order], pushes[order], normals[order]


@njit(cache=True, error_model="numpy")
def _crowds(bearings: Floats, pushes: Floats, spread: float) -> Floats:
    """Weighted number of points that share each point's push, itself included; also across ±π."""
    n = len(bearings)
    crowds = np.ones(n)
    for i in range(n):
        # Go counter-clockwise from point i, across ±π, until the bearings are `spread` apart.
        for k in range(i + 1, i + n):
            j = k if k < n else k - n
            separation = bearings[j] - bearings[i] + (0.0 if k < n else 2.0 * math.pi)
            if separation >= spread:
                break
            # A neighbour counts in proportion to its nearness, and less if its push is the weaker one.
            proximity, ratio = 1.0 - separation / spread, pushes[j] / pushes[i]
            crowds[i] += proximity * min(1.0, ratio)
            crowds[j] += proximity * min(1.0, 1.0 / ratio)
    return crowds
