"""Elastic band: a path deformed by seen obstacles, and a controller that follows it."""

from lme.planners.eband.planner import EBand

__all__ = ["EBand"]
