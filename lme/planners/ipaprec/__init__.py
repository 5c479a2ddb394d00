"""MAER-Nav and DRL-NSUO: learned local planners that see the nearest return of each sector."""

from lme.planners.ipaprec.planner import IpapRec

__all__ = ["IpapRec"]
