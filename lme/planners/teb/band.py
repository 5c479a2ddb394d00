"""Timed elastic band: its settings, its start along a path, its motion with the robot, and its optimisation."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from scipy.linalg.lapack import dpbsv

from lme.errors import require
from lme.geometry.frames import wrap_angle
from lme.mapping.costmap import LocalCostmapConfig
from lme.planners.teb.kernels import Bounds, Weights, along, near_obstacles, normal_equations, resized
from lme.types import Floats, Limits, Pose, Twist

_NOT_NEGATIVE = (
    "dt_hysteresis",
    "force_reinit_new_goal_dist",
    "force_reinit_new_goal_angular",
    "feasibility_check_no_poses",
    "max_vel_x_backwards",
    "xy_goal_tolerance",
    "min_obstacle_dist",
    "obstacle_association_force_inclusion_factor",
    "obstacle_association_cutoff_factor",
    "costmap_obstacles_behind_robot_dist",
    "penalty_epsilon",
    "shrink_horizon_min_duration",
    "oscillation_v_eps",
    "oscillation_omega_eps",
    "oscillation_recovery_min_duration",
    "oscillation_filter_duration",
)
_WEIGHTS = (
    "optimaltime",
    "max_vel_x",
    "max_vel_theta",
    "acc_lim_x",
    "acc_lim_theta",
    "kinematics_nh",
    "kinematics_forward_drive",
    "obstacle",
    "viapoint",
    "prefer_rotdir",
)
_MAX_PASSED = 10  # samples, at most, that the robot leaves behind in one period
# g2o's OptimizationAlgorithmLevenberg.
_FIRST_DAMPING = 1e-5  # of the greatest diagonal element
_TRIALS = 10  # of damping in one iteration
_LEAST_SCALE, _GREATEST_SCALE = 1.0 / 3.0, 2.0 / 3.0  # of the damping after success
_LEAST_GAIN = 1e-3  # keeps the expected gain from zero

Equations = Callable[[Floats, Floats], tuple[float, Floats, Floats]]


@dataclass(slots=True)
class TebConfig:
    """Settings with the names of teb_local_planner; the values are those of EW-Glab's BARN entry."""

    dt_ref: float
    dt_hysteresis: float
    min_samples: int
    max_samples: int
    max_global_plan_lookahead_dist: float
    global_plan_viapoint_sep: float
    path_spacing: float
    force_reinit_new_goal_dist: float
    force_reinit_new_goal_angular: float
    feasibility_check_no_poses: int
    max_vel_x: float
    max_vel_x_backwards: float
    max_vel_theta: float
    acc_lim_x: float
    acc_lim_theta: float
    xy_goal_tolerance: float
    min_obstacle_dist: float
    obstacle_association_force_inclusion_factor: float
    obstacle_association_cutoff_factor: float
    costmap_obstacles_behind_robot_dist: float
    no_inner_iterations: int
    no_outer_iterations: int
    penalty_epsilon: float
    weight_optimaltime: float
    weight_max_vel_x: float
    weight_max_vel_theta: float
    weight_acc_lim_x: float
    weight_acc_lim_theta: float
    weight_kinematics_nh: float
    weight_kinematics_forward_drive: float
    weight_obstacle: float
    weight_viapoint: float
    weight_prefer_rotdir: float
    weight_adapt_factor: float
    shrink_horizon_min_duration: float
    oscillation_v_eps: float
    oscillation_omega_eps: float
    oscillation_recovery_min_duration: float
    oscillation_filter_duration: float
    divergence_detection_max_chi_squared: float | None
    costmap: LocalCostmapConfig

    def __post_init__(self) -> None:
        for key in ("dt_ref", "max_global_plan_lookahead_dist", "global_plan_viapoint_sep", "path_spacing"):
            require(key, getattr(self, key), above=0.0)
        for key in ("max_vel_x", "max_vel_theta", "acc_lim_x", "acc_lim_theta", "weight_adapt_factor"):
            require(key, getattr(self, key), above=0.0)
        for key in _NOT_NEGATIVE + tuple(f"weight_{name}" for name in _WEIGHTS):
            require(key, getattr(self, key), at_least=0.0)
        if self.divergence_detection_max_chi_squared is not None:
            max_chi_squared = self.divergence_detection_max_chi_squared
            require("divergence_detection_max_chi_squared", max_chi_squared, above=0.0)
        require("min_samples", self.min_samples, at_least=2)
        require("max_samples", self.max_samples, at_least=self.min_samples, at_most=10_000)
        for key in ("no_inner_iterations", "no_outer_iterations"):
            require(key, getattr(self, key), at_least=1)

    def weights(self, factor: float) -> Weights:
        """Return the weights in the order of the normal equations, that of the obstacles times `factor`."""
        values = [float(getattr(self, f"weight_{name}")) for name in _WEIGHTS]
        values[_WEIGHTS.index("obstacle")] *= factor
        return cast("Weights", tuple(values))


class LocalPath(NamedTuple):
    """Path ahead in the odometry frame.

    points (P, 2), P ≥ 1, from the robot to the local goal, via (V, 2): points to pass [m]. yaw: at the goal [rad].
    """

    points: Floats
    via: Floats
    yaw: float


class TimedBand:
    """Poses (N, 3), N ≥ 3, in the odometry frame and the time differences (N − 1,) [s] between them.

    Rösmann et al. 2012, "Trajectory modification considering dynamic constraints of autonomous robots" (ROBOTIK), as in
    teb_local_planner. Both ends are fixed: the robot's pose and the local goal, where it is at rest.
    """

    def __init__(self, config: TebConfig, box: tuple[float, float, float]) -> None:
        """box: half length, half width and rounding of the footprint [m]."""
        self._config = config
        self._box = box
        self.reset()

    def reset(self) -> None:
        """Forget the band."""
        self.poses: Floats = np.empty((0, 3))
        self.times: Floats = np.empty(0)

    def follow(self, route: LocalPath, robot: Pose, limits: Limits) -> None:
        """Move the ends to the robot and to the local goal, or start anew if the local goal has jumped."""
        goal = np.append(route.points[-1], route.yaw)
        if len(self.poses) == 0 or self._jumped(goal):
            v, omega = self._bounds(limits)[1:3]
            self.poses, self.times = along(route.points, robot, route.yaw, v, omega)
            return
        num_passed = self._num_passed(robot)
        self.poses = np.vstack([robot, self.poses[num_passed + 1 :]])
        self.times = np.append(self.times[:1], self.times[num_passed + 1 :])
        self.poses[-1] = goal

    def optimize(self, via: Floats, points: Floats, twist: Twist, limits: Limits, turn: float) -> float:
        """Adjust the band in `no_outer_iterations` rounds; return its sum of squared errors, inf if it is lost.

        Each round adds and removes samples and finds the obstacles (M, 2) near them anew; the next round weights
        these more. turn: wanted direction of turns, 1 left, -1 right, 0 any.
        """
        config, bounds = self._config, self._bounds(limits)
        forced_distance = config.min_obstacle_dist * config.obstacle_association_force_inclusion_factor
        ignored_distance = config.min_obstacle_dist * config.obstacle_association_cutoff_factor
        sizes = (config.dt_ref, config.dt_hysteresis, config.min_samples, config.max_samples)
        total = math.inf
        for k in range(config.no_outer_iterations):
            self.poses, self.times = resized(self.poses, self.times, *sizes)
            obstacles = near_obstacles(self.poses, points, self._box, forced_distance, ignored_distance)
            passes = self._via_poses(via)
            weights = config.weights(config.weight_adapt_factor**k)
            equations = _equations(twist, obstacles, passes, turn, self._box, bounds, weights)
            iterations = config.no_inner_iterations
            self.poses, self.times, total = optimize(self.poses, self.times, equations, iterations)
        return total

    def command(self) -> tuple[float, float]:
        """Velocity and turn rate of the first motion."""
        (x, y, yaw), following = self.poses[0].tolist(), self.poses[1].tolist()
        dx, dy = following[0] - x, following[1] - y
        ahead = math.copysign(1.0, math.cos(yaw) * dx + math.sin(yaw) * dy)
        dt = float(self.times[0])
        return ahead * math.hypot(dx, dy) / dt, wrap_angle(following[2] - yaw) / dt

    def _jumped(self, goal: Floats) -> bool:
        """Return whether the local goal has moved or turned too far."""
        config, end = self._config, self.poses[-1]
        distance = math.hypot(goal[0] - end[0], goal[1] - end[1])
        angle = abs(wrap_angle(goal[2] - end[2]))
        return distance >= config.force_reinit_new_goal_dist or angle >= config.force_reinit_new_goal_angular

    def _num_passed(self, robot: Pose) -> int:
        """Number of samples that the robot has passed: those before the first one after which they get farther."""
        max_passed = min(len(self.poses) - self._config.min_samples, _MAX_PASSED)
        distances = np.hypot(*(self.poses[: max_passed + 1, :2] - robot[:2]).T)
        increases = np.flatnonzero(np.diff(distances) >= 0.0)
        return int(increases[0]) if len(increases) else max(len(distances) - 1, 0)

    def _via_poses(self, via: Floats) -> Floats:
        """Assign a pose to each point to pass (V, 2): (K, 3) [index, x, y], without points near the robot."""
        if len(via) == 0 or len(self.poses) < 3:
            return np.empty((0, 3))
        distances = np.hypot(*(self.poses[:, None, :2] - via).transpose(2, 0, 1))
        index = np.minimum(distances.argmin(axis=0), len(self.poses) - 2)
        passes: Floats = np.column_stack([index, via])[index > 0]
        return passes

    def _bounds(self, robot: Limits) -> Bounds:
        """Return the configured limits within those of the robot, in the order of the normal equations."""
        config = self._config
        return (
            min(config.max_vel_x_backwards, -robot.lowest),
            min(config.max_vel_x, robot.v_max),
            min(config.max_vel_theta, robot.omega_max),
            min(config.acc_lim_x, robot.alpha_v),
            min(config.acc_lim_theta, robot.alpha_omega),
            config.min_obstacle_dist,
            config.penalty_epsilon,
        )


def _equations(*arguments: Any) -> Equations:
    """Return the normal equations as a function of the band alone, given the other arguments."""
    return lambda poses, times: normal_equations(poses, times, *arguments)


def optimize(
    poses: Floats, times: Floats, equations: Equations, iterations: int
) -> tuple[Floats, Floats, float]:
    """Return the band after a number of iterations, and its sum of squared errors.

    equations: gives the sum, the banded matrix and the descent at a band
    (`lme.planners.teb.kernels.normal_equations`). The damping is that of g2o (Kümmerle et al. 2011, DOI
    10.1109/ICRA.2011.5979949). A step to a time difference that is not positive is refused. The sum is inf if it is
    not finite at the given band.
    """
    total, matrix, descent = equations(poses, times)
    if not np.isfinite(total):
        return poses, times, np.inf
    damping, growth = _FIRST_DAMPING * float(matrix[0].max()), 2.0
    for _ in range(iterations):
        for _ in range(_TRIALS):
            # Try a step; it must keep all time differences positive.
            step = _step(matrix, descent, damping)
            new_band = poses + step[:, :3], times + step[:-1, 3]
            candidate = equations(*new_band) if new_band[1].min() > 0.0 else (np.inf, matrix, descent)
            # Ratio of the actual to the expected decrease of the sum.
            flat = step.ravel()
            gain = (total - candidate[0]) / float(flat @ (damping * flat + descent) + _LEAST_GAIN)
            if gain > 0.0 and np.isfinite(candidate[0]):
                (poses, times), (total, matrix, descent) = new_band, candidate
                # Accepted: less damping the better the prediction was.
                damping *= min(max(1.0 - (2.0 * gain - 1.0) ** 3, _LEAST_SCALE), _GREATEST_SCALE)
                growth = 2.0
                break
            # Refused: more damping, ever faster.
            damping, growth = damping * growth, growth * 2.0
        else:
            break
    return poses, times, total


def _step(matrix: Floats, descent: Floats, damping: float) -> Floats:
    """Damped step (N, 4) of all variables; zero if the damped matrix is not positive definite."""
    damped = matrix.copy()
    damped[0] += damping
    _, step, failed = dpbsv(damped, descent, lower=1, overwrite_ab=1)
    return np.zeros((len(descent) // 4, 4)) if failed else step.reshape(-1, 4)
