"""DRL-DCLP: a learned local planner that is told the robot's size and limits."""

from lme.planners.dclp.planner import Dclp

__all__ = ["Dclp"]
