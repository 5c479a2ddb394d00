"""Shortest paths on a costmap of the scans or of the true map."""

from lme.guides.global_path.guide import GlobalPath, GlobalPlanner
from lme.guides.global_path.navfn import Navfn

__all__ = ["GlobalPath", "GlobalPlanner", "Navfn"]
