"""Settings of the timed elastic band, with the names of teb_local_planner and the values of EW-Glab's BARN entry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

from lme.errors import require
from lme.mapping.costmap import LocalCostmapConfig
from lme.planners.teb.kernels import Weights

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
        for key in _POSITIVE + _POSITIVE_LIMITS:
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
