"""Model predictive path integral control, with the critics and the sampling of Nav2's controller."""

from lme.planners.mppi.planner import Mppi

__all__ = ["Mppi"]
