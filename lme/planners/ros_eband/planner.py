"""ROS move_base with eband_local_planner."""

from __future__ import annotations

from dataclasses import dataclass

from lme.mapping.costmap import LocalCostmap
from lme.planners.move_base import MoveBase, check_move_base
from lme.planners.ros_eband.band import BandConfig, ElasticBand
from lme.robots import Robot


@dataclass(slots=True)
class RosEBandConfig(BandConfig):
    """Settings of move_base and EBandPlannerROS, with the names of ROS and the values of the entry."""

    xy_goal_tolerance: float
    yaw_goal_tolerance: float
    acc_lim_theta: float
    min_in_place_vel_theta: float
    max_vel_theta: float
    planner_patience: float
    controller_patience: float

    def __post_init__(self) -> None:
        BandConfig.__post_init__(self)
        check_move_base(self)


class RosEBand(MoveBase):
    """move_base with eband_local_planner, as an entry of the BARN Challenge drove it; see `ElasticBand`."""

    Config = RosEBandConfig

    def __init__(self, config: RosEBandConfig, robot: Robot) -> None:
        costmap = LocalCostmap(config.costmap, robot)
        super().__init__(config, robot, costmap, ElasticBand(config, costmap))
