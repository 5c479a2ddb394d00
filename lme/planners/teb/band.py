"""Timed elastic band: started along a path, moved along with the robot, and optimised."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from lme.geometry.frames import wrap_angle
from lme.planners.teb.config import TebConfig
from lme.planners.teb.kernels import Bounds, along, near_obstacles, normal_equations, resized
from lme.planners.teb.optimizer import Equations, optimize
from lme.types import Floats, Limits, Pose, Twist

_MAX_PASSED = 10  # samples, at most, that the robot leaves behind in one period


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
