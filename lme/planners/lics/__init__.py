"""LiCS: the transformer that won the BARN Challenge of 2024, and the controller around it."""

from lme.planners.lics.planner import Lics

__all__ = ["Lics"]
