"""Minimum-time arcs: LME+'s own planner."""

from lme.planners.min_time.planner import MinTime

__all__ = ["MinTime"]
