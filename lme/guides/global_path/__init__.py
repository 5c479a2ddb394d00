"""A shortest path on a costmap, from scans or from the true map."""

from lme.guides.global_path.guide import GlobalPath

__all__ = ["GlobalPath"]
