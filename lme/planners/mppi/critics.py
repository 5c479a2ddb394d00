"""Critics of the BARN Challenge's ROS 2 stack, in its order."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import to_world
from lme.grids.obstacle_grid import HIGHEST
from lme.mapping.costmap import LocalCostmap
from lme.planners.mppi.config import MppiConfig
from lme.planners.mppi.kernels import critics
from lme.planners.mppi.kernels.rollout import Singles
from lme.robots import Robot
from lme.types import Floats, Observation


class Critics:
    """Adds up the costs that the critics assign to each trajectory.

    Nav2's GoalAngleCritic is missing: goals here have no heading. The critics that the challenge does not use are, too.
    """

    def __init__(self, config: MppiConfig, costmap: LocalCostmap, robot: Robot) -> None:
        self._config = config
        self._costmap = costmap
        inscribed = robot.footprint.inscribed_radius + config.costmap.footprint_padding
        self._possible = _cost_at_corner(config, costmap.outline, inscribed)

    def score(
        self,
        observation: Observation,
        path: Floats,
        speeds: Singles,
        poses: Singles,
        bounds: tuple[float, float],
    ) -> tuple[Floats, bool]:
        """Return the costs (N,) of the trajectories, and whether some trajectory is free.

        path (P, 2), P ≥ 2, from the robot on, and poses (N, T, 3) are in the odometry frame; speeds (N, T); bounds of
        the velocity (v_min, v_max) [m/s].
        """
        config, map_, dt = self._config, self._costmap, self._config.model_dt
        target_distance = math.hypot(*observation.target)
        costs = np.zeros(len(poses))
        # Critics of velocity and obstacles, for every distance to the target.
        critics.constraint(costs, speeds, bounds, dt, config.constraint.cost_weight)
        cost = config.cost
        collide = critics.obstacles(
            costs,
            poses,
            cost.trajectory_point_step,
            map_.costs,
            map_.grid,
            map_.outline,
            self._possible,
            (cost.collision_cost, cost.critical_cost, cost.cost_weight),
            target_distance < cost.near_goal_distance,
        )
        # Critics that count only near the target, or only away from it.
        if target_distance < config.goal.threshold_to_consider:
            x, y = to_world(observation.target, observation.odometry)
            critics.goal(costs, poses, (float(x), float(y)), config.goal.cost_weight)
        self._along_path(costs, observation, path, poses, target_distance)
        if target_distance >= config.prefer_forward.threshold_to_consider:
            critics.prefer_forward(costs, speeds, dt, config.prefer_forward.cost_weight)
        return costs, not collide

    def _along_path(
        self, costs: Floats, observation: Observation, path: Floats, poses: Singles, target_distance: float
    ) -> None:
        """Apply the critics of the path. target_distance: distance to the target [m]."""
        config, map_ = self._config, self._costmap
        # Points of the path that are free, and the furthest one that some trajectory reaches.
        free = critics.free_points(path, map_.costs, map_.grid)
        furthest = critics.furthest_reached(poses, path)
        align, follow, angle = config.path_align, config.path_follow, config.path_angle
        if target_distance >= align.threshold_to_consider:
            critics.path_align(
                costs,
                poses,
                path,
                free,
                furthest,
                align.trajectory_point_step,
                align.offset_from_furthest,
                align.max_path_occupancy_ratio,
                align.cost_weight,
            )
        if target_distance >= follow.threshold_to_consider:
            critics.path_follow(
                costs, poses, path, free, furthest, follow.offset_from_furthest, follow.cost_weight
            )
        if target_distance >= angle.threshold_to_consider:
            index = min(furthest + angle.offset_from_furthest, len(path) - 1)
            max_angle, weight = angle.max_angle_to_furthest, angle.cost_weight
            critics.path_angle(costs, poses, path, observation.odometry, index, max_angle, weight)


def _cost_at_corner(config: MppiConfig, outline: Floats, inscribed: float) -> float:
    """Least cost at which a corner of the outline (P, 2) may touch an obstacle; 0 if the inflation ends before."""
    corner = float(np.hypot(*outline.T).max())
    if config.costmap.inflation_radius < corner:
        return 0.0
    return math.floor(HIGHEST * math.exp(-config.costmap.cost_scaling_factor * (corner - inscribed)))
