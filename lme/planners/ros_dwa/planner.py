"""ROS move_base with TrajectoryPlannerROS."""

from __future__ import annotations

from dataclasses import dataclass

from lme.mapping.costmap import LocalCostmap
from lme.planners.move_base import MoveBase, check_move_base
from lme.planners.ros_dwa.trajectories import TrajectoriesConfig, TrajectorySearch
from lme.robots import Robot


@dataclass(slots=True)
class RosDwaConfig(TrajectoriesConfig):
    """Settings of move_base and TrajectoryPlannerROS, with the names and the BARN Challenge's values of ROS."""

    xy_goal_tolerance: float
    yaw_goal_tolerance: float
    planner_patience: float
    controller_patience: float

    def __post_init__(self) -> None:
        TrajectoriesConfig.__post_init__(self)
        check_move_base(self)


class RosDwa(MoveBase):
    """move_base with base_local_planner's TrajectoryPlannerROS, DWA mode; github.com/ros-planning/navigation.

    Velocities are simulated on a local costmap and scored by distance to the path, distance to its end on the map,
    and the highest cost on the way.
    """

    Config = RosDwaConfig

    def __init__(self, config: RosDwaConfig, robot: Robot) -> None:
        costmap = LocalCostmap(config.costmap, robot)
        search = TrajectorySearch(config, robot, costmap)
        super().__init__(config, robot, costmap, search, config.costmap.cell_size)
