"""Settings of MPPI, with the names of nav2_mppi_controller and the values of the BARN Challenge's ROS 2 stack."""

from __future__ import annotations

from dataclasses import dataclass

from lme.errors import require
from lme.mapping.costmap import LocalCostmapConfig


@dataclass(slots=True)
class WeightConfig:
    """Critic with nothing but a weight."""

    cost_weight: float


@dataclass(slots=True)
class ObstacleCostConfig:
    """CostCritic: costs of the map under the robot."""

    cost_weight: float
    critical_cost: float
    collision_cost: float
    near_goal_distance: float
    trajectory_point_step: int


@dataclass(slots=True)
class GoalCostConfig:
    """GoalCritic: distance to the target."""

    cost_weight: float
    threshold_to_consider: float


@dataclass(slots=True)
class PathAlignConfig:
    """PathAlignCritic: distance to the path, at equal path lengths."""

    cost_weight: float
    max_path_occupancy_ratio: float
    trajectory_point_step: int
    threshold_to_consider: float
    offset_from_furthest: int


@dataclass(slots=True)
class PathFollowConfig:
    """PathFollowCritic: distance from the end of a trajectory to a point of the path."""

    cost_weight: float
    offset_from_furthest: int
    threshold_to_consider: float


@dataclass(slots=True)
class PathAngleConfig:
    """PathAngleCritic: angle between the end of a trajectory and a point of the path."""

    cost_weight: float
    offset_from_furthest: int
    threshold_to_consider: float
    max_angle_to_furthest: float


@dataclass(slots=True)
class PreferForwardConfig:
    """PreferForwardCritic: distance driven backwards."""

    cost_weight: float
    threshold_to_consider: float


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

    time_steps: int
    model_dt: float
    batch_size: int
    iteration_count: int
    retry_attempt_limit: int
    vx_std: float
    wz_std: float
    vx_max: float
    vx_min: float
    wz_max: float
    ax_max: float
    ax_min: float
    az_max: float
    temperature: float
    gamma: float
    prune_distance: float
    path_spacing: float
    xy_goal_tolerance: float
    constraint: WeightConfig
    cost: ObstacleCostConfig
    goal: GoalCostConfig
    path_align: PathAlignConfig
    path_follow: PathFollowConfig
    path_angle: PathAngleConfig
    prefer_forward: PreferForwardConfig
    costmap: LocalCostmapConfig

    def __post_init__(self) -> None:
        for key in _POSITIVE + _POSITIVE_DISTANCES:
            require(key, getattr(self, key), above=0.0)
        for key in ("gamma", "xy_goal_tolerance", "retry_attempt_limit"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("vx_min", "ax_min"):
            require(key, getattr(self, key), at_most=0.0)
        require("time_steps", self.time_steps, at_least=_SHORTEST, at_most=500)
        require("batch_size", self.batch_size, at_least=1, at_most=50_000)
        require("iteration_count", self.iteration_count, at_least=1)
        for critic in _CRITICS:
            require(f"{critic}.cost_weight", getattr(self, critic).cost_weight, at_least=0.0)
        for critic, (key, minimum) in _COUNTS.items():
            require(f"{critic}.{key}", getattr(getattr(self, critic), key), at_least=minimum)


_SHORTEST = 10  # [steps] the filter looks at nine of them
