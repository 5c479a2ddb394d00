"""A floor plan: its obstacles and its outline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lme.types import Floats
from lme.worlds.world import World


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Content of a map file.

    world: the obstacles, including the closed outer wall. outline: (4, 2) corners in order [m]. start, goal: as
    `map.start` and `map.goal` of `map=file`, if the file has them.
    """

    world: World
    outline: Floats
    start: tuple[float, ...] | None = None
    goal: tuple[float, ...] | None = None

    @property
    def region(self) -> str:
        """Region of the map in words: ranges of x and y, or its corners if its sides are not parallel to the axes."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        if (np.isclose(self.outline, low) | np.isclose(self.outline, high)).all():
            return f"in x {low[0]:g} to {high[0]:g} m, y {low[1]:g} to {high[1]:g} m"
        corners = ", ".join(f"({x:g}, {y:g})" for x, y in self.outline.round(6).tolist())
        return f"within the corners {corners} m"


def enclosed(outline: Floats, circles: Floats, segments: Floats, polygons: tuple[Floats, ...]) -> FloorPlan:
    """Return the plan with these obstacles and a thin wall along its outline (4, 2) [m]."""
    wall = np.hstack([outline, np.roll(outline, -1, axis=0)])
    return FloorPlan(World(circles, np.vstack([wall, segments]), polygons), outline)
