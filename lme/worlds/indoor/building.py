"""A building: free rectangles cut out of solid, and furniture in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lme.worlds.contours import outlines
from lme.worlds.floor_plan import FloorPlan, enclosed
from lme.worlds.indoor.cells import CELL_M, Rectangle
from lme.worlds.indoor.furniture import Piece


@dataclass(frozen=True, slots=True)
class Building:
    """Free space is the union of rooms and doors, less the furniture. size: cells along x and along y."""

    size: tuple[int, int]
    rooms: list[Rectangle]
    doors: list[Rectangle]
    furniture: list[Piece]

    def floor_plan(self) -> FloorPlan:
        """The building in metres, with its lower left corner at the origin."""
        columns, rows = self.size
        solid = np.ones((rows, columns), dtype=bool)
        for free in (*self.rooms, *self.doors):
            solid[free.y0 : free.y1, free.x0 : free.x1] = False
        for box in (box for piece in self.furniture for box in piece.boxes):
            solid[box.y0 : box.y1, box.x0 : box.x1] = True
        chairs = np.array([chair for piece in self.furniture for chair in piece.chairs]).reshape(-1, 4)
        discs = np.column_stack([chairs[:, :2] + chairs[:, 2:], chairs[:, 2] - chairs[:, 0]]) / 2
        corners = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]]) * CELL_M
        polygons = tuple(outline * CELL_M for outline in outlines(solid))
        return enclosed(corners, discs * CELL_M, np.empty((0, 4)), polygons)
