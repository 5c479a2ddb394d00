"""Rows of panels of one width; sizes are in inches, so that texts do not overlap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from runners.figures.parts.scene import Box, frame_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Item = TypeVar("Item")


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
    """The largest width of `count` panels in `columns` columns on a page [in]. aspect: height over width."""
    rows = math.ceil(count / columns)
    across = (page[0] - around.left) / columns - around.gap
    down = (page[1] - around.header - around.footer) / rows - around.per_row
    return min(across, down / aspect)


def best_columns(count: int, aspect: float, page: tuple[float, float], around: Around) -> int:
    """The number of columns that gives the widest panels."""
    return max(range(1, count + 1), key=lambda columns: panel_width(columns, count, aspect, page, around))


def wrapped(items: Sequence[Item], columns: int) -> list[list[Item]]:
    """Rows of at most `columns` items."""
    return [list(items[first : first + columns]) for first in range(0, len(items), columns)]


def lay_out(
    figure: Figure, rows: Sequence[Sequence[Box]], width_in: float, around: Around, least_in: float = 0.0
) -> list[list[Axes]]:
    """Add one framed panel per box, all of one width, and set the figure's size, at least `least_in` wide.

    A row is as high as its highest box.
    """
    tall = [width_in * max(map(aspect_of, row)) for row in rows]
    grid = max(map(len, rows)) * (width_in + around.gap) + around.left
    page = max(grid, least_in)
    height = around.header + around.footer + sum(tall) + len(rows) * around.per_row
    figure.set_size_inches(page, height)
    left, top = (page - grid) / 2 + around.left, height - around.header
    panels = []
    for row, row_in in zip(rows, tall, strict=True):
        bottom = top - around.title - row_in
        places = [(left + column * (width_in + around.gap), bottom) for column in range(len(row))]
        panels.append(
            [
                _panel(figure, box, (x / page, y / height, width_in / page, row_in / height))
                for box, (x, y) in zip(row, places, strict=True)
            ]
        )
        top -= row_in + around.per_row
    return panels


def aspect_of(box: Box) -> float:
    """Height over width."""
    return (box.y1 - box.y0) / (box.x1 - box.x0)


def _panel(figure: Figure, box: Box, rectangle: tuple[float, float, float, float]) -> Axes:
    axes = figure.add_axes(rectangle)
    frame_panel(axes, box)
    return axes
