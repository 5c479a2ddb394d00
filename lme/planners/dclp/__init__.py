"""DRL-DCLP: a learned local planner that takes the robot's size and limits as inputs."""

from lme.planners.dclp.planner import Dclp

__all__ = ["Dclp"]
