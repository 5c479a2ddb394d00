"""VFH+: steering towards the cheapest gap of a polar histogram."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import argument_error, require
from lme.grids.polar_histogram import (
    active_cells,
    candidate_directions,
    cheapest,
    masked,
    polar_density,
    turning_limits,
)
from lme.perception.scan_points import BlindArc
from lme.planners.commands import StoppingGuard, approach
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

_LEAST_CELL = 0.01  # [m] a finer grid would take longer than a control period


@dataclass(slots=True)
class VfhPlusConfig:
    """Settings; `conf/planner/vfh_plus.yaml` gives their sources."""

    cell_size: float
    window: float
    sector_angle: float
    safety_distance: float
    peak: float
    density_low: float
    density_high: float
    wide_valley: float
    cost_target: float
    cost_heading: float
    cost_previous: float
    turn_gain: float
    density_stop: float
    margin: float

    def __post_init__(self) -> None:
        for key in ("window", "density_high", "wide_valley", "turn_gain", "density_stop"):
            require(key, getattr(self, key), above=0.0)
        for key in ("safety_distance", "density_low", "margin"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("cost_target", "cost_heading", "cost_previous"):
            require(key, getattr(self, key), at_least=0.0)
        require("cell_size", self.cell_size, at_least=_LEAST_CELL)
        require("sector_angle", self.sector_angle, at_least=math.radians(0.5), at_most=math.pi / 4)
        require("peak", self.peak, at_least=1.0)
        if self.density_low > self.density_high:
            raise argument_error(
                f"density_low is {self.density_low:g}: must be at most density_high, {self.density_high:g}"
            )


class VfhPlus:
    """Vector Field Histogram + (Ulrich & Borenstein 1998, DOI 10.1109/ROBOT.1998.677362).

    The active window of the histogram grid contains the current scan and the points remembered in the lidar's
    blind arc; a cell with a point has certainty 1. Obstacles behind the subgoal are ignored. The speed is that
    of VFH (Borenstein & Koren 1991, DOI 10.1109/70.88137): lower in dense directions and in turns. If the robot
    cannot steer into any gap at its speed, it stops and turns. A `StoppingGuard` slows commands that are not safe.
    """

    Config = VfhPlusConfig

    def __init__(self, config: VfhPlusConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._mount = robot.lidar.mount
        self._radius = robot.r + config.safety_distance
        self._num_sectors = round(2.0 * math.pi / config.sector_angle)
        self._alpha = 2.0 * math.pi / self._num_sectors
        self._wide_valley = config.wide_valley / self._alpha
        self._costs = (config.cost_target, config.cost_heading, config.cost_previous)
        self._guard = StoppingGuard(robot, config.margin)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the remembered points, the binary histogram and the previous direction."""
        self._blind = BlindArc(self._mount, self._config.window)
        self._blocked = np.zeros(self._num_sectors, dtype=np.bool_)
        self._previous: float | None = None  # direction in the odometry frame, in sectors

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        x, y = map(float, guidance.subgoal)
        yaw = observation.odometry.yaw
        points = self._blind.points(observation)
        config, distance = self._config, math.hypot(x, y)
        # Primary histogram, then the binary one with hysteresis (first and second stage).
        cells = active_cells(points, config.cell_size, min(config.window, distance + self._radius))
        density = polar_density(cells, yaw, self._radius, config.window, config.peak, self._num_sectors)
        self._blocked = (density > config.density_high) | (self._blocked & (density >= config.density_low))
        target = yaw + math.atan2(y, x)
        # Masked histogram and choice of a direction.
        direction, stop = self._direction(cells, target, observation)
        desired = self._drive(direction, stop, density, distance, observation)
        return self._guard.guard(desired, observation, points)

    def _direction(self, cells: Floats, target: float, observation: Observation) -> tuple[float | None, bool]:
        """Direction relative to the heading [rad], None if all are blocked, and whether to stop first."""
        yaw = observation.odometry.yaw
        turn_radius = abs(observation.ramp_start.v) / observation.limits.omega_max
        limits = turning_limits(cells, turn_radius, self._radius)
        # Without a previous choice, the heading takes its place.
        heading = yaw / self._alpha
        previous = heading if self._previous is None else self._previous
        references = (target / self._alpha, heading, previous)
        for blocked, stop in ((masked(self._blocked, yaw, *limits), False), (self._blocked, True)):
            candidates = candidate_directions(blocked, target / self._alpha, self._wide_valley)
            if len(candidates) > 0:
                index = cheapest(candidates, self._costs, references, self._num_sectors)
                self._previous = best = float(candidates[index])
                return self._turn(best, target, yaw), stop
        self._previous = None
        return None, True

    def _turn(self, sector: float, target: float, yaw: float) -> float:
        """Chosen direction relative to the heading [rad]; straight behind, the turn passes the target."""
        turn = math.remainder(sector * self._alpha - yaw, math.tau)
        if abs(turn) > math.pi - 1e-9:
            return math.copysign(turn, math.remainder(target - yaw, math.tau))
        return turn

    def _drive(
        self, direction: float | None, stop: bool, density: Floats, distance: float, observation: Observation
    ) -> Twist:
        """Turn towards the direction, with a speed limited by density and turn."""
        if direction is None:
            return Twist(0.0, 0.0)
        limits, twist, config = observation.limits, observation.ramp_start, self._config
        # Turn rate: proportional to the direction, and slow enough to stop at it.
        fastest = approach(direction, twist.omega, limits.omega_max, limits.alpha_omega, self._dt)
        gentle = config.turn_gain * direction
        omega = min(fastest, gentle) if direction > 0.0 else max(fastest, gentle)
        if stop:
            return Twist(0.0, omega)
        # Speed: lower where the histogram is dense ahead, and in turns.
        ahead = density[round(observation.odometry.yaw / self._alpha) % self._num_sectors]
        calm = 1.0 - min(ahead / config.density_stop, 1.0)
        v_max = limits.v_max * calm * max(1.0 - abs(gentle) / limits.omega_max, 0.0)
        return Twist(approach(distance, twist.v, v_max, limits.alpha_v, self._dt), omega)
