"""Local planner of ROS move_base, as the organisers of the BARN Challenge use it."""

from lme.planners.ros_dwa.planner import RosDwa

__all__ = ["RosDwa"]
