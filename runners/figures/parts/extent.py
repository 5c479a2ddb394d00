"""The extent of a world, and its size as text."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import to_world
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import Task
from runners.config.map_sets import Chosen
from runners.figures.parts.scene import Box, extremes

SIDES = 24  # of the polygon that outlines a disc


def extent(task: Task) -> Box:
    """The box around obstacles, movers at their first pose, start and goal."""
    ends = np.array([task.start[:2], task.goal])
    movers = (mover_outline(mover) for mover in task.world.movers)
    points = np.vstack([ends, extremes(task.world), *movers])
    return Box(*points.min(axis=0).tolist(), *points.max(axis=0).tolist())


def mover_outline(mover: Mover) -> Floats:
    """(V, 2) corners of a mover at its first pose [m]; a disc becomes a polygon of `SIDES` sides."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    outline = mover.outline
    if outline is None:
        outline = (mover.radius or 0.0) * np.column_stack([np.cos(angles), np.sin(angles)])
    return to_world(outline, Pose(*mover.path[0].tolist()))


def metres(task: Task) -> str:
    """The size of a world as text, start and goal included, rounded to half a metre."""
    box = extent(task)
    return " × ".join(f"{round(2 * side) / 2:g}" for side in (box.x1 - box.x0, box.y1 - box.y0)) + " m"


def describe_set(chosen: Chosen, task: Task) -> str:
    """Two lines: the size of the world shown, and the number of worlds."""
    count = len(chosen.maps.numbers)
    choice = f", {chosen.choice}" if chosen.choice else ""
    return f"{metres(task)}\n{count} world{'s' * (count > 1)}{choice}"
