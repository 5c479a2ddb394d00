"""Maps from scans and poses: what the beams met and passed, as cells."""

from lme.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, GridMap, OccupancyGrid

__all__ = ["FREE", "OCCUPIED", "UNKNOWN", "GridMap", "OccupancyGrid"]
