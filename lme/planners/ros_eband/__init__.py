"""Local planner eband_local_planner of ROS move_base, as an entry of the BARN Challenge used it."""

from lme.planners.ros_eband.planner import RosEBand

__all__ = ["RosEBand"]
