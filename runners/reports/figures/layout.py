"""Rows of panels of equal width. Sizes are in inches, so that texts do not overlap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from lme.geometry.frames import to_world
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import Task
from runners.config.map_sets import MapSetChoice
from runners.reports.figures.scene import Box, extremes, frame_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Item = TypeVar("Item")
SIDES = 24  # of the polygon that outlines a disc


class Around(NamedTuple):
    """Free space [in]: above, below and between panels, and at the left, upper and lower edge of the page."""

    title: float = 0.22
    foot: float = 0.0
    gap: float = 0.12
    left: float = 0.12
    header: float = 0.0
    footer: float = 0.0

    @property
    def per_row(self) -> float:
        """Height of a row without its panels."""
        return self.title + self.foot + self.gap


def panel_width(columns: int, count: int, aspect: float, page: tuple[float, float], around: Around) -> float:
    """Return the largest width of `count` panels in `columns` columns on a page [in]. aspect: height over width."""
    rows = math.ceil(count / columns)
    max_width = (page[0] - around.left) / columns - around.gap
    max_height = (page[1] - around.header - around.footer) / rows - around.per_row
    return min(max_width, max_height / aspect)


def best_columns(count: int, aspect: float, page: tuple[float, float], around: Around) -> int:
    """Return the number of columns that gives the widest panels."""
    return max(range(1, count + 1), key=lambda columns: panel_width(columns, count, aspect, page, around))


def wrapped(items: Sequence[Item], columns: int) -> list[list[Item]]:
    """Return rows of at most `columns` items."""
    return [list(items[first : first + columns]) for first in range(0, len(items), columns)]


def lay_out(
    figure: Figure, rows: Sequence[Sequence[Box]], width_in: float, around: Around, least_in: float = 0.0
) -> list[list[Axes]]:
    """Add one framed panel per box, all of one width, and set the figure's size, at least `least_in` wide.

    A row is as high as its highest box.
    """
    # Heights of the rows, and the size of the page.
    row_heights = [width_in * max(map(aspect_of, row)) for row in rows]
    grid = max(map(len, rows)) * (width_in + around.gap) + around.left
    page = max(grid, least_in)
    height = around.header + around.footer + sum(row_heights) + len(rows) * around.per_row
    figure.set_size_inches(page, height)
    # Place the panels from the top down, all relative to the page.
    left, top = (page - grid) / 2 + around.left, height - around.header
    panels = []
    for row, row_in in zip(rows, row_heights, strict=True):
        bottom = top - around.title - row_in
        corners = [(left + column * (width_in + around.gap), bottom) for column in range(len(row))]
        panels.append(
            [
                _panel(figure, box, (x / page, y / height, width_in / page, row_in / height))
                for box, (x, y) in zip(row, corners, strict=True)
            ]
        )
        top -= row_in + around.per_row
    return panels


def aspect_of(box: Box) -> float:
    """Return height over width."""
    return (box.y1 - box.y0) / (box.x1 - box.x0)


def _panel(figure: Figure, box: Box, rectangle: tuple[float, float, float, float]) -> Axes:
    axes = figure.add_axes(rectangle)
    frame_panel(axes, box)
    return axes


def extent(task: Task) -> Box:
    """Return the box around obstacles, movers at their first pose, start and goal."""
    ends = np.array([task.start[:2], task.goal])
    movers = (mover_outline(mover) for mover in task.world.movers)
    points = np.vstack([ends, extremes(task.world), *movers])
    return Box(*points.min(axis=0).tolist(), *points.max(axis=0).tolist())


def mover_outline(mover: Mover) -> Floats:
    """Return (V, 2) corners of a mover at its first pose [m]; a disc becomes a polygon of `SIDES` sides."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    outline = mover.outline
    if outline is None:
        outline = (mover.radius or 0.0) * np.column_stack([np.cos(angles), np.sin(angles)])
    return to_world(outline, Pose(*mover.path[0].tolist()))


def metres(task: Task) -> str:
    """Return the size of a world as text, start and goal included, rounded to half a metre."""
    box = extent(task)
    return " × ".join(f"{round(2 * side) / 2:g}" for side in (box.x1 - box.x0, box.y1 - box.y0)) + " m"


def describe_set(chosen: MapSetChoice, task: Task) -> str:
    """Return two lines: the size of the world shown, and the number of worlds."""
    count = len(chosen.maps.numbers)
    choice = f", {chosen.choice}" if chosen.choice else ""
    return f"{metres(task)}\n{count} world{'s' * (count > 1)}{choice}"
