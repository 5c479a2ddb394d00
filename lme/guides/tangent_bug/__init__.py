"""TangentBug, which passes obstacles by the ends that a range sensor sees."""

from lme.guides.tangent_bug.guide import TangentBug

__all__ = ["TangentBug"]
