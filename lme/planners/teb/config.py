"""Settings of the timed elastic band, with the names of teb_local_planner and the values of EW-Glab's BARN entry."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import cast

from lme.errors import require
from lme.mapping.local_costmap import LocalCostmapConfig
from lme.planners.teb.kernels import Weights


def _costmap() -> LocalCostmapConfig:
    return LocalCostmapConfig(size=20.0, footprint_padding=0.07, inflation_radius=0.0)


_POSITIVE = (
    "dt_ref",
    "max_global_plan_lookahead_dist",
    "global_plan_viapoint_sep",
    "path_spacing",
    "max_vel_x",
)
_POSITIVE_LIMITS = ("max_vel_theta", "acc_lim_x", "acc_lim_theta", "weight_adapt_factor")
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


@dataclass(slots=True)
class TebConfig:
    """Samples, path, limits, obstacles, optimisation, recovery and local costmap."""

    dt_ref: float = 0.3  # [s]
    dt_hysteresis: float = 0.1  # [s]
    min_samples: int = 3
    max_samples: int = 500
    max_global_plan_lookahead_dist: float = 3.0  # [m]
    global_plan_viapoint_sep: float = 0.3  # [m]
    path_spacing: float = 0.05  # [m]
    force_reinit_new_goal_dist: float = 1.0  # [m]
    force_reinit_new_goal_angular: float = math.pi / 2  # [rad]
    feasibility_check_no_poses: int = 2
    max_vel_x: float = 0.8  # [m/s]
    max_vel_x_backwards: float = 0.0  # [m/s]
    max_vel_theta: float = 1.57  # [rad/s]
    acc_lim_x: float = 8.0  # [m/s²]
    acc_lim_theta: float = 20.0  # [rad/s²]
    xy_goal_tolerance: float = 0.1  # [m]
    min_obstacle_dist: float = 0.13  # [m]
    obstacle_association_force_inclusion_factor: float = 1.5
    obstacle_association_cutoff_factor: float = 5.0
    costmap_obstacles_behind_robot_dist: float = 0.15  # [m]
    no_inner_iterations: int = 5
    no_outer_iterations: int = 4
    penalty_epsilon: float = 0.1  # of every limit, in its unit
    weight_optimaltime: float = 10.0
    weight_max_vel_x: float = 3.0
    weight_max_vel_theta: float = 1.0
    weight_acc_lim_x: float = 2.0
    weight_acc_lim_theta: float = 2.0
    weight_kinematics_nh: float = 100.0
    weight_kinematics_forward_drive: float = 700.0
    weight_obstacle: float = 15.0
    weight_viapoint: float = 3.0
    weight_prefer_rotdir: float = 50.0
    weight_adapt_factor: float = 2.0
    shrink_horizon_min_duration: float = 10.0  # [s]
    oscillation_v_eps: float = 0.1
    oscillation_omega_eps: float = 0.1
    oscillation_recovery_min_duration: float = 10.0  # [s]
    oscillation_filter_duration: float = 10.0  # [s]
    divergence_detection_max_chi_squared: float | None = None  # None: no limit
    costmap: LocalCostmapConfig = field(default_factory=_costmap)

    def __post_init__(self) -> None:
        for key in _POSITIVE + _POSITIVE_LIMITS:
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in _NOT_NEGATIVE + tuple(f"weight_{name}" for name in _WEIGHTS):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        if self.divergence_detection_max_chi_squared is not None:
            max_chi_squared = self.divergence_detection_max_chi_squared
            require("planner.divergence_detection_max_chi_squared", max_chi_squared, above=0.0)
        require("planner.min_samples", self.min_samples, at_least=2)
        require("planner.max_samples", self.max_samples, at_least=self.min_samples, at_most=10_000)
        for key in ("no_inner_iterations", "no_outer_iterations"):
            require(f"planner.{key}", getattr(self, key), at_least=1)

    def weights(self, factor: float) -> Weights:
        """Return the weights in the order of the normal equations, that of the obstacles times `factor`."""
        values = [float(getattr(self, f"weight_{name}")) for name in _WEIGHTS]
        values[_WEIGHTS.index("obstacle")] *= factor
        return cast("Weights", tuple(values))
