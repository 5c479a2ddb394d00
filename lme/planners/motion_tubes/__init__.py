"""Motion tubes (KUL+FM): arcs of constant curvature, checked against the scan."""

from lme.planners.motion_tubes.planner import MotionTubes

__all__ = ["MotionTubes"]
