"""Optimal reciprocal collision avoidance as a local planner."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lme.errors import require
from lme.geometry.motion import WIDEST, movers_among
from lme.geometry.orca import before_point, beside_disc, best_velocity
from lme.perception.scan_points import BlindArc
from lme.planners.commands import StoppingGuard, approach
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

_MIN_SPEED = 0.02  # [m/s] slower velocities have no direction to turn to


@dataclass(slots=True)
class OrcaConfig:
    """Settings; `conf/planner/orca.yaml` explains them."""

    horizon: float
    wall_horizon: float
    share: float
    clearance: float
    turn_time: float
    margin: float

    def __post_init__(self) -> None:
        for key in ("horizon", "wall_horizon", "turn_time"):
            require(key, getattr(self, key), above=0.0)
        require("share", self.share, above=0.0, at_most=1.0)
        for key in ("clearance", "margin"):
            require(key, getattr(self, key), at_least=0.0)


class Orca:
    """ORCA (van den Berg et al. 2011, DOI 10.1007/978-3-642-19457-3_1) for a robot that cannot drive sideways.

    The robot is a disc of its collision radius and `clearance`, which leaves room for what follows. Tracked people are
    discs that do their share of every evasion; without a tracker they are static obstacles. Scan points, also
    those remembered in a blind arc, bound the velocity towards them. The robot takes the permitted velocity that is
    nearest to driving straight to the subgoal. As in NH-ORCA (Alonso-Mora et al. 2013, DOI
    10.1007/978-3-642-32723-0_15) the robot turns to it in `turn_time` and meanwhile drives as fast as the velocity is
    along its heading. A `StoppingGuard` slows commands that are not safe.
    """

    Config = OrcaConfig

    def __init__(self, config: OrcaConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._mount = robot.lidar.mount
        self._radius = robot.r + config.clearance
        self._reach = self._radius + robot.v_max * config.wall_horizon
        self._guard = StoppingGuard(robot, config.margin)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the remembered points; `rng` is not used."""
        self._blind = BlindArc(self._mount, self._reach)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        scan_points = self._blind.points(observation)
        is_mover, people = movers_among(scan_points, scan_points, observation.pedestrians, WIDEST)
        points = scan_points[~is_mover]
        x, y = map(float, guidance.subgoal)
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        limits, twist = observation.limits, observation.ramp_start
        speed = approach(distance, max(twist.v, 0.0), limits.v_max, limits.alpha_v, self._dt)
        preferred = (speed * math.cos(bearing), speed * math.sin(bearing))
        config = self._config
        times = (config.horizon, config.wall_horizon, self._dt)
        bounds = (self._radius, float(limits.v_max), config.share)
        vx, vy = permitted(preferred, (float(twist.v), 0.0), points, people, times, bounds)
        # The command that comes nearest to this velocity; a standing robot turns to its subgoal.
        heading = math.atan2(vy, vx) if math.hypot(vx, vy) > _MIN_SPEED else bearing
        desired = Twist(max(vx, 0.0), heading / config.turn_time)
        return self._guard.guard(desired, observation, points)


@njit(cache=True, error_model="numpy")
def permitted(
    preferred: tuple[float, float],
    velocity: tuple[float, float],
    points: Floats,
    people: Floats,
    times: tuple[float, float, float],
    bounds: tuple[float, float, float],
) -> tuple[float, float]:
    """Return the permitted velocity nearest to the wanted one (vx, vy) [m/s], in the robot frame.

    velocity: the robot's. points (M, 2) of static obstacles; people (P, 5): x, y, vx, vy, radius. times: horizon for
    people and for points, and the period [s]. bounds: radius [m], v_max [m/s], and the robot's share of an evasion.
    """
    horizon, wall_horizon, dt = times
    radius, v_max, responsibility = bounds
    lines = np.empty((len(points) + len(people), 4))
    hard = 0
    # Static points give hard half-planes, which come first in `lines`.
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        if math.hypot(x, y) <= radius + v_max * wall_horizon:
            before_point(x, y, radius, wall_horizon, lines[hard])
            hard += 1
    # People give soft half-planes, each with the robot's share of the evasion.
    count = hard
    for k in range(len(people)):
        reach = radius + people[k, 4]
        beside_disc(people[k, :2], velocity, people[k, 2:4], reach, horizon, dt, responsibility, lines[count])
        count += 1
    # The velocity in all half-planes, and no faster than v_max, that is nearest to the wanted one.
    permitted_velocity: tuple[float, float] = best_velocity(lines[:count], hard, v_max, preferred)
    return permitted_velocity
