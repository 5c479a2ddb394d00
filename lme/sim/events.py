"""What ends a motion: contact or arrival."""

from __future__ import annotations

import numpy as np

from lme.kernels.first_event import first_event
from lme.types import Floats
from lme.worlds.world import Task


def until_event(
    travel: Floats, task: Task, box: tuple[float, float, float], circles: Floats, edges: Floats
) -> tuple[Floats, float, bool, bool]:
    """The poses up to contact or arrival, least clearance [m], contact, arrival.

    travel (K, 3); box of what collides; circles (C, 3) and edges (E, 4). Contact on arrival counts as contact only.
    """
    goal = np.asarray(task.goal, dtype=np.float64)
    passed, clearance, contact, arrived = first_event(
        travel, goal, float(task.goal_tolerance), box, circles, edges
    )
    return travel[:passed], clearance, contact, arrived
