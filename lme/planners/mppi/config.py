"""Settings of MPPI, with the names of nav2_mppi_controller and the values of the BARN Challenge's ROS 2 stack."""

from __future__ import annotations

from dataclasses import dataclass, field

from lme.errors import require
from lme.mapping.local_costmap import LocalCostmapConfig


def _costmap() -> LocalCostmapConfig:
    return LocalCostmapConfig(
        cell_size=0.06, size=5.0, footprint_padding=0.01, inflation_radius=0.8, cost_scaling_factor=4.0
    )


@dataclass(slots=True)
class WeightConfig:
    """Critic with nothing but a weight."""

    cost_weight: float = 4.0


@dataclass(slots=True)
class ObstacleCostConfig:
    """CostCritic: costs of the map under the robot."""

    cost_weight: float = 3.81
    critical_cost: float = 300.0  # of a pose whose middle is within the inscribed radius of an obstacle
    collision_cost: float = 1_000_000.0  # of a trajectory whose outline touches an obstacle
    near_goal_distance: float = 1.0  # [m] nearer to the target than this, only near collisions cost
    trajectory_point_step: int = 2  # every which pose is looked at


@dataclass(slots=True)
class GoalCostConfig:
    """GoalCritic: distance to the target."""

    cost_weight: float = 5.0
    threshold_to_consider: float = 1.4  # [m] only nearer to the target than this


@dataclass(slots=True)
class PathAlignConfig:
    """PathAlignCritic: distance to the path, at equal path lengths."""

    cost_weight: float = 14.0
    max_path_occupancy_ratio: float = 0.05  # of blocked points; with more the critic is silent
    trajectory_point_step: int = 4
    threshold_to_consider: float = 0.5  # [m] only farther from the target than this
    offset_from_furthest: int = 20  # [points] only if a trajectory comes this far along the path


@dataclass(slots=True)
class PathFollowConfig:
    """PathFollowCritic: distance from the end of a trajectory to a point of the path."""

    cost_weight: float = 5.0
    offset_from_furthest: int = 5  # [points] beyond the farthest that any trajectory reaches
    threshold_to_consider: float = 1.4  # [m] only farther from the target than this


@dataclass(slots=True)
class PathAngleConfig:
    """PathAngleCritic: angle between the end of a trajectory and a point of the path."""

    cost_weight: float = 2.0
    offset_from_furthest: int = 4  # [points] beyond the farthest that any trajectory reaches
    threshold_to_consider: float = 0.5  # [m] only farther from the target than this
    max_angle_to_furthest: float = 1.0  # [rad] only if the robot is turned away by more


@dataclass(slots=True)
class PreferForwardConfig:
    """PreferForwardCritic: distance driven backwards."""

    cost_weight: float = 5.0
    threshold_to_consider: float = 0.5  # [m] only farther from the target than this


_POSITIVE = ("model_dt", "vx_std", "wz_std", "vx_max", "wz_max", "ax_max", "az_max", "temperature")
_POSITIVE_DISTANCES = ("prune_distance", "path_spacing")
_CRITICS = ("constraint", "cost", "goal", "path_align", "path_follow", "path_angle", "prefer_forward")
_COUNTS = {
    "cost": ("trajectory_point_step", 1),
    "path_align": ("trajectory_point_step", 1),
    "path_follow": ("offset_from_furthest", 0),
    "path_angle": ("offset_from_furthest", 0),
}


@dataclass(slots=True)
class MppiConfig:
    """Samples, limits, path, critics and local costmap."""

    time_steps: int = 56
    model_dt: float = 0.05  # [s]
    batch_size: int = 2000
    iteration_count: int = 1
    retry_attempt_limit: int = 1  # new samples from rest if all of them touch obstacles
    vx_std: float = 0.2  # [m/s]
    wz_std: float = 0.4  # [rad/s]
    vx_max: float = 0.5  # [m/s]
    vx_min: float = -0.35  # [m/s]
    wz_max: float = 1.9  # [rad/s]
    ax_max: float = 10.0  # [m/s²]
    ax_min: float = -10.0  # [m/s²]
    az_max: float = 20.0  # [rad/s²]
    temperature: float = 0.3
    gamma: float = 0.015
    prune_distance: float = 1.7  # [m]
    path_spacing: float = 0.03  # [m]
    xy_goal_tolerance: float = 0.15  # [m]
    constraint: WeightConfig = field(default_factory=WeightConfig)
    cost: ObstacleCostConfig = field(default_factory=ObstacleCostConfig)
    goal: GoalCostConfig = field(default_factory=GoalCostConfig)
    path_align: PathAlignConfig = field(default_factory=PathAlignConfig)
    path_follow: PathFollowConfig = field(default_factory=PathFollowConfig)
    path_angle: PathAngleConfig = field(default_factory=PathAngleConfig)
    prefer_forward: PreferForwardConfig = field(default_factory=PreferForwardConfig)
    costmap: LocalCostmapConfig = field(default_factory=_costmap)

    def __post_init__(self) -> None:
        for key in _POSITIVE + _POSITIVE_DISTANCES:
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in ("gamma", "xy_goal_tolerance", "retry_attempt_limit"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        for key in ("vx_min", "ax_min"):
            require(f"planner.{key}", getattr(self, key), at_most=0.0)
        require("planner.time_steps", self.time_steps, at_least=_SHORTEST, at_most=500)
        require("planner.batch_size", self.batch_size, at_least=1, at_most=50_000)
        require("planner.iteration_count", self.iteration_count, at_least=1)
        for critic in _CRITICS:
            require(f"planner.{critic}.cost_weight", getattr(self, critic).cost_weight, at_least=0.0)
        for critic, (key, minimum) in _COUNTS.items():
            require(f"planner.{critic}.{key}", getattr(getattr(self, critic), key), at_least=minimum)


_SHORTEST = 10  # [steps] the filter looks at nine of them
