"""Events that end a motion: contact and arrival."""

from __future__ import annotations

import numpy as np

from lme.geometry.collision import first_event
from lme.grids.edge_grid import near_edges
from lme.types import Floats
from lme.worlds.world import Task, World


def until_event(
    travel: Floats, task: Task, box: tuple[float, float, float], circles: Floats, edges: Floats
) -> tuple[Floats, float, bool, bool]:
    """Return the poses up to contact or arrival, least clearance [m], contact, arrival.

    travel (K, 3); box: the collision footprint; circles (C, 3) and edges (E, 4), those of the task's world first.
    Contact on arrival counts as contact only.
    """
    edges = nearby(task.world, travel, box, edges)
    goal = np.asarray(task.goal, dtype=np.float64)
    driven, clearance, contact, arrived = first_event(
        travel, goal, float(task.goal_tolerance), box, circles, edges
    )
    return travel[:driven], clearance, contact, arrived


def nearby(world: World, poses: Floats, box: tuple[float, float, float], edges: Floats) -> Floats:
    """Drop edges that are too far away to be the nearest one to a motion. edges (E, 4): the world's come first.

    poses (K, 3) and box (half_length, half_width, rounding) [m] of the footprint. All of a small world's edges stay.
    """
    if not len(world.grid.edges):
        return edges
    near_world, crowd_edges = near_edges(world.grid, poses, box), edges[len(world.edges) :]
    return np.vstack([near_world, crowd_edges]) if len(crowd_edges) else near_world
