"""Generated buildings: corridors, offices, and floor plans that are split at random."""

from lme.worlds.indoor.map_set import Indoor, IndoorConfig

__all__ = ["Indoor", "IndoorConfig"]
