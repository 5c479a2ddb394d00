"""DRL-VO: a learned local planner that sees past scans and pedestrians."""

from lme.planners.drl_vo.planner import DrlVo

__all__ = ["DrlVo"]
