"""Velocity search of base_local_planner's TrajectoryPlanner in its DWA mode."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import wrap_angle
from lme.grids.obstacle_grid import covered_cells, lattice
from lme.mapping.costmap import LocalCostmap, LocalCostmapConfig
from lme.planners.ros_dwa.kernels import LOST, distances, score, way_cells
from lme.robots import Robot
from lme.types import Floats, Limits, Observation, Pose, Twist

_MOST_SAMPLES = 201  # of v and of ω: all poses of every pair's trajectory are held


@dataclass(slots=True)
class TrajectoriesConfig:
    """Velocities, samples, simulation and scores, with the names of ROS."""

    max_vel_x: float
    min_vel_x: float
    max_vel_theta: float
    min_in_place_vel_theta: float
    escape_vel: float
    acc_lim_x: float
    acc_lim_theta: float
    sim_time: float
    sim_granularity: float
    angular_sim_granularity: float
    vx_samples: int
    vtheta_samples: int
    pdist_scale: float
    gdist_scale: float
    occdist_scale: float
    meter_scoring: bool
    heading_lookahead: float
    oscillation_reset_dist: float
    escape_reset_dist: float
    escape_reset_theta: float
    costmap: LocalCostmapConfig

    def __post_init__(self) -> None:
        for key in ("max_vel_x", "max_vel_theta", "acc_lim_x", "acc_lim_theta"):
            require(key, getattr(self, key), above=0.0)
        for key in ("sim_time", "sim_granularity", "angular_sim_granularity"):
            require(key, getattr(self, key), above=0.0)
        for key in ("min_vel_x", "min_in_place_vel_theta", "pdist_scale", "gdist_scale", "occdist_scale"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("heading_lookahead", "oscillation_reset_dist", "escape_reset_dist", "escape_reset_theta"):
            require(key, getattr(self, key), at_least=0.0)
        require("min_vel_x", self.min_vel_x, at_most=self.max_vel_x)
        require("escape_vel", self.escape_vel, at_most=0.0)
        for key in ("vx_samples", "vtheta_samples"):
            require(key, getattr(self, key), at_least=2, at_most=_MOST_SAMPLES)


@dataclass(slots=True)
class _Scored:
    """Sampled velocities (N, 2), their scores (N,), inf for invalid trajectories, and the last poses (N, 3)."""

    twists: Floats
    scores: Floats
    ends: Floats

    def __post_init__(self) -> None:
        self.scores = np.where(self.scores >= 0.0, self.scores, math.inf)

    @property
    def least(self) -> float:
        """Least score; inf if no trajectory is valid."""
        return float(self.scores.min(initial=math.inf))

    def best(self) -> Twist | None:
        """First velocity with the least score; None if no trajectory is valid."""
        return Twist(*self.twists[self.scores.argmin()].tolist()) if self.least < math.inf else None


class TrajectorySearch:
    """Samples velocities, simulates and scores them, turns in place, and backs up if nothing else is possible.

    Two turns in place to one side forbid turns to the other side until the robot has moved on. Once it has begun
    to back up, it drives forward again only after it has moved or turned away.
    """

    def __init__(self, config: TrajectoriesConfig, robot: Robot, costmap: LocalCostmap) -> None:
        self._config = config
        self._dt, self._v_max = robot.dt, robot.v_max
        self._costmap = costmap
        cell = config.costmap.cell_size if config.meter_scoring else 1.0
        self._scales = (config.pdist_scale * cell, config.gdist_scale * cell, config.occdist_scale)
        self._simulation = (config.sim_time, config.sim_granularity, config.angular_sim_granularity)
        self._window = self._within_reach()
        self.reset()

    def _within_reach(self) -> tuple[int, int, int, int]:
        """Rows and columns of the part of the map that trajectories can reach."""
        config = self._config
        fastest = max(config.max_vel_x, -config.escape_vel)
        reach = fastest * config.sim_time + config.heading_lookahead
        if config.costmap.update_rate is not None:  # the robot is no longer in the middle
            reach += self._v_max * (1.0 / config.costmap.update_rate + self._dt)
        cells = math.ceil(reach / config.costmap.cell_size) + 2
        middle = self._costmap.costs.shape[0] // 2
        return middle - cells, middle + cells + 1, middle - cells, middle + cells + 1

    def reset(self) -> None:
        """Forget turns and escapes."""
        self._turns = {-1: 0, 1: 0}  # in place, to the right and to the left
        self._turned_at = (0.0, 0.0)
        self._escape: Pose | None = None

    def set_plan(self, path: Floats, pose: Pose) -> bool:
        """Take a path (K, 2) in the odometry frame [m]."""
        self._path = path
        return True

    def command(self, observation: Observation) -> Twist | None:
        """Return the best velocity along the path; None if the robot must stop."""
        path = self._path
        pose, limits = observation.odometry, self._limits(observation.limits)
        self._measure(pose, path)
        samples = self._samples(observation, path, limits)
        samples = samples[:0] if self._escape else samples
        forward = _Scored(samples, *self._score(samples, observation, math.inf, best_only=True))
        samples = self._in_place(observation.ramp_start, limits)
        turns = _Scored(samples, *self._score(samples, observation, forward.least, best_only=False))
        best = self._choose(forward, turns)
        if best is None:
            best = self._back_up(observation, limits)
        elif best.v == 0.0:
            self._turns[1 if best.omega > 0.0 else -1] += 1
            self._turned_at = pose[:2]
        self._lift_bans(pose)
        return best

    def _limits(self, robot: Limits) -> Limits:
        """Return the configured limits within those of the robot."""
        config = self._config
        configured = Limits(config.max_vel_x, config.max_vel_theta, config.acc_lim_x, config.acc_lim_theta)
        smaller = zip(Limits._fields, map(min, configured.bounds, robot.bounds), strict=False)
        return robot._replace(**dict(smaller))

    def _measure(self, pose: Pose, path: Floats) -> None:
        """Measure the distances of all cells to the path and to its last point on the map."""
        costmap, reach = self._costmap, self._config.costmap.size / 2.0
        shape = costmap.costs.shape
        cells = way_cells(path, pose[:2], reach, costmap.grid, shape)
        covered = covered_cells(costmap.outline, pose, costmap.grid, shape)
        nowhere = np.zeros(shape, dtype=np.bool_)
        self._to_path = distances(costmap.costs, covered, cells, self._window)
        self._to_goal = distances(costmap.costs, nowhere, cells[-1:], self._window)

    def _samples(self, observation: Observation, path: Floats, limits: Limits) -> Floats:
        """Forward velocities of the dynamic window: (N, 2), slow ones first, straight ones before turns."""
        config, (v, omega), dt = self._config, observation.ramp_start, self._dt
        remaining = math.dist(path[-1], observation.odometry[:2])
        slowest = min(config.min_vel_x, limits.v_max)
        fastest = min(limits.v_max, remaining / config.sim_time, v + limits.alpha_v * dt)
        low = max(slowest, v - limits.alpha_v * dt)
        speeds = np.linspace(low, max(fastest, slowest), config.vx_samples)
        turns = np.append(0.0, self._turn_rates(omega, limits)[:-1])  # the last one is not used, as in ROS
        return np.column_stack([np.repeat(speeds, turns.size), np.tile(turns, speeds.size)])

    def _turn_rates(self, omega: float, limits: Limits) -> Floats:
        """Turn rates of the dynamic window, from right to left: (vtheta_samples,)."""
        low = max(-limits.omega_max, omega - limits.alpha_omega * self._dt)
        high = min(limits.omega_max, omega + limits.alpha_omega * self._dt)
        return np.linspace(low, high, self._config.vtheta_samples)

    def _in_place(self, twist: Twist, limits: Limits) -> Floats:
        """Turns in place: (N, 2), none of them slow."""
        rates = self._turn_rates(twist.omega, limits)
        slowest = min(self._config.min_in_place_vel_theta, limits.omega_max)
        turn_rates = np.where(rates > 0.0, np.maximum(rates, slowest), np.minimum(rates, -slowest))
        turn_rates = turn_rates[np.abs(rates) > (rates[-1] - rates[0]) / (rates.size - 1)]
        return np.column_stack([np.zeros(turn_rates.size), turn_rates])

    def _score(
        self, twists: Floats, observation: Observation, best_cost: float, best_only: bool
    ) -> tuple[Floats, Floats]:
        """Scores and ends of trajectories; see `lme.planners.ros_dwa.kernels.score`."""
        costmap, limits = self._costmap, self._limits(observation.limits)
        return score(
            twists,
            observation.odometry,
            observation.ramp_start,
            (limits.alpha_v, limits.alpha_omega),
            self._simulation,
            costmap.outline,
            costmap.costs,
            costmap.grid,
            self._to_path,
            self._to_goal,
            self._scales,
            best_cost,
            best_only,
        )

    def _choose(self, forward: _Scored, turns: _Scored) -> Twist | None:
        """Choose the best forward trajectory, unless an equally good turn in place faces a cell nearer the goal."""
        best, min_cost, nearest = forward.best(), forward.least, math.inf
        for twist, total, end in zip(turns.twists, turns.scores, turns.ends, strict=True):
            side = 1 if twist[1] > 0.0 else -1
            ahead = self._goal_distance_ahead(end)
            if total < math.inf and total <= min_cost and self._turns[-side] < 2 and ahead < nearest:
                nearest, min_cost, best = ahead, float(total), Twist(*twist.tolist())
        return best

    def _goal_distance_ahead(self, end: Floats) -> float:
        """Distance to the goal from the cell ahead of a pose [cells]: the most if there is no way, inf off the map."""
        grid, lookahead = self._costmap.grid, self._config.heading_lookahead
        i = lattice((end[0] + lookahead * math.cos(end[2])) / grid[2]) - grid[0]
        j = lattice((end[1] + lookahead * math.sin(end[2])) / grid[2]) - grid[1]
        rows, columns = self._to_goal.shape
        if not (0 <= i < rows and 0 <= j < columns):
            return math.inf
        return float(self._to_goal[i, j]) if self._to_goal[i, j] >= 0 else float(rows * columns)

    def _back_up(self, observation: Observation, limits: Limits) -> Twist | None:
        """Back up, even into obstacles, as ROS does; None from a cell without a way to the goal."""
        escape = Twist(max(self._config.escape_vel, limits.lowest), 0.0)
        scores, _ = self._score(np.array([escape]), observation, math.inf, False)
        if scores[0] == LOST:
            return None
        self._escape = self._escape or observation.odometry
        return escape

    def _lift_bans(self, pose: Pose) -> None:
        """Allow all turns and forward driving again once the robot is far enough from where they were forbidden."""
        config, position = self._config, pose[:2]
        if math.dist(position, self._turned_at) > config.oscillation_reset_dist:
            self._turns = {-1: 0, 1: 0}
        if self._escape is not None and (
            math.dist(position, self._escape[:2]) > config.escape_reset_dist
            or abs(wrap_angle(pose.yaw - self._escape.yaw)) > config.escape_reset_theta
        ):
            self._escape = None
