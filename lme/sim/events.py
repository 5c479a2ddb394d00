"""What ends a motion: contact or arrival."""

from __future__ import annotations

import numpy as np

from lme.kernels.collision import sweep
from lme.kernels.motion import first_within
from lme.types import Floats
from lme.worlds.world import Task


def until_event(
    travel: Floats, task: Task, box: tuple[float, float, float], circles: Floats, edges: Floats
) -> tuple[Floats, float, bool, bool]:
    """The poses up to contact or arrival, least clearance [m], contact, arrival.

    travel (K, 3); box of what collides; circles (C, 3) and edges (E, 4). Contact on arrival counts as contact only.
    """
    arrival = first_within(travel, np.asarray(task.goal, dtype=np.float64), task.goal_tolerance)
    if arrival >= 0:
        travel = travel[: arrival + 1]
    clearance, contact = sweep(travel, box, circles, edges)
    if contact >= 0:
        travel = travel[: contact + 1]
    return travel, clearance, contact >= 0, arrival >= 0 and contact < 0
