"""Clearance of the points of a lattice in a floor plan."""

from __future__ import annotations

import numpy as np

from lme.types import Bools, Floats
from lme.worlds import clearance_kernels as kernels
from lme.worlds.world import FloorPlan


def clearance_field(plan: FloorPlan, x: Floats, y: Floats, reach: float) -> Floats:
    """(Y, X) distance of each lattice point to the nearest obstacle [m], at most `reach`.

    Zero in solid obstacles and outside the plan's outline. x (X,) and y (Y,) rise evenly [m].
    """
    field = np.where(inside(plan.outline, x, y), float(reach), 0.0)
    world = plan.world
    kernels.shorten_to_circles(
        field, x, y, float(reach), np.ascontiguousarray(world.circles, dtype=np.float64)
    )
    kernels.shorten_to_edges(field, x, y, float(reach), world.edges)
    if world.polygons:
        ends = np.cumsum([len(polygon) for polygon in world.polygons])
        kernels.clear_inside(field, x, y, np.vstack(world.polygons, dtype=np.float64), ends)
    return field


def inside(polygon: Floats, x: Floats, y: Floats) -> Bools:
    """Return (Y, X) whether each lattice point lies in a polygon (V, 2), by the even–odd rule."""
    corners = np.ascontiguousarray(polygon, dtype=np.float64)
    is_inside: Bools = kernels.inside(corners, 0, len(corners), x, y)
    return is_inside
