"""Timed elastic band: a trajectory of poses and time differences, optimised along the path ahead."""

from lme.planners.teb.planner import Teb

__all__ = ["Teb"]
