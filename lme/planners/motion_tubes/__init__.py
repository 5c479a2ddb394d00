"""Motion tubes: arcs of constant curvature that are checked against the scan, and the choice among them (KUL+FM)."""

from lme.planners.motion_tubes.planner import MotionTubes

__all__ = ["MotionTubes"]
