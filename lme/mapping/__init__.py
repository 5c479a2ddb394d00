"""Maps from scans and poses: cells that the beams hit and passed."""

from lme.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, GridMap, OccupancyGrid

__all__ = ["FREE", "OCCUPIED", "UNKNOWN", "GridMap", "OccupancyGrid"]
