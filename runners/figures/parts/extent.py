"""How far a world reaches, and the words for it."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import to_world
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import Task
from runners.config.map_sets import Chosen
from runners.figures.parts.scene import Box, extremes

SIDES = 24  # of the outline of a disc


def extent(task: Task) -> Box:
    """The box around all obstacles, movers where they stand at first, start and goal."""
    ends = np.array([task.start[:2], task.goal])
    movers = (mover_outline(mover) for mover in task.world.movers)
    points = np.vstack([ends, extremes(task.world), *movers])
    return Box(*points.min(axis=0).tolist(), *points.max(axis=0).tolist())


def mover_outline(mover: Mover) -> Floats:
    """(V, 2) corners of a mover where it stands at first [m]; a disc's are so many that it looks round."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    outline = mover.outline
    if outline is None:
        outline = (mover.radius or 0.0) * np.column_stack([np.cos(angles), np.sin(angles)])
    return to_world(outline, Pose(*mover.path[0].tolist()))


def metres(task: Task) -> str:
    """How large a world is, start and goal included, to half a metre, in words."""
    box = extent(task)
    return " × ".join(f"{round(2 * side) / 2:g}" for side in (box.x1 - box.x0, box.y1 - box.y0)) + " m"


def about_set(chosen: Chosen, task: Task) -> str:
    """Size of the world shown, and on a second line how many there are."""
    count = len(chosen.maps.numbers)
    choice = f", {chosen.choice}" if chosen.choice else ""
    return f"{metres(task)}\n{count} world{'s' * (count > 1)}{choice}"
