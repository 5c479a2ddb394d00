"""A simulated Livox Mid-360: point clouds of a solid-state 3D lidar in a world with heights."""

from lme.simulation.mid360.sensor import Mid360, mid360_of

__all__ = ["Mid360", "mid360_of"]
