"""Elastic band: a path deformed by the obstacles that are seen, and a controller that follows it."""

from lme.planners.eband.planner import EBand

__all__ = ["EBand"]
