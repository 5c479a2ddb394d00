"""Motion tubes (KUL+FM): arcs of constant curvature, checked against the scan. One is chosen, or many vote."""

from lme.planners.motion_tubes.planner import MotionTubes
from lme.planners.motion_tubes.tube_vote import TubeVote

__all__ = ["MotionTubes", "TubeVote"]
