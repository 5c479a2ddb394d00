"""The page of a features figure: equal panels, each with a title and a colour bar, a heading, a key and a note."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from runners.reports.figures import robot_view as view
from runners.reports.figures.driven_runs import (
    DecisionView,
    candidate_reach,
    draw_heading,
    heading,
    heading_height,
)
from runners.reports.figures.robot_view import draw_key, key
from runners.reports.figures.scene import frame_panel
from runners.reports.figures.style import INK, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAGE_IN, EDGE_IN, GAP_IN, WIDEST_IN = 7.0, 0.08, 0.12, 3.2
TITLE_IN, BELOW_IN = 0.22, 0.36  # above and below a panel
BAR_IN, BAR_TOP_IN = 0.08, 0.07  # height of a colour bar, its distance from the panel
KEY_LINE_IN, KEY_COLUMNS, NOTE_IN = 0.155, 4, 0.34


def columns(panels: int) -> int:
    """Return the number of panels in a row, with a free place for the key if that adds no row."""
    return panels + 1 if panels < 4 else 3 if panels in (5, 6) else 4


class FeaturePage:
    """A page of equal panels, each with a title above and a colour bar below."""

    def __init__(self, shot: DecisionView, panels: int) -> None:
        self._shot = shot
        self._panels, self._columns = panels, columns(panels)
        self._box = view.reach_box(shot.why.candidates, candidate_reach(shot.trace))
        self._lines = heading(shot)
        self._key = key(shot.why, candidate_reach(shot.trace), self._box)
        inner = PAGE_IN - 2 * EDGE_IN - (self._columns - 1) * GAP_IN
        self._width = min(inner / self._columns, WIDEST_IN)
        self._tall = self._width * (self._box.y1 - self._box.y0) / (self._box.x1 - self._box.x0)
        self._rows = math.ceil(panels / self._columns)
        self._top = heading_height(self._lines) - 0.05  # titles have their own space above
        self._foot = NOTE_IN + (0 if self._has_place else self._key_rows * KEY_LINE_IN + 0.05)
        self._row = TITLE_IN + self._tall + BELOW_IN
        self._height = self._top + self._rows * self._row + self._foot
        self.figure = new_figure(PAGE_IN, self._height, layout=None)

    @property
    def _has_place(self) -> bool:
        return self._rows * self._columns > self._panels

    @property
    def _key_rows(self) -> int:
        return math.ceil(len(self._key) / KEY_COLUMNS)

    def panel(self, index: int, title: str) -> Axes:
        """Return the axes of a panel."""
        x, y = self._corner(index)
        axes = self._axes(x, y, self._width, self._tall)
        frame_panel(axes, self._box)
        axes.set_title(title, fontsize=8, color=INK, pad=3)
        return axes

    def bar(self, index: int) -> Axes:
        """Return the axes of the colour bar below a panel."""
        x, y = self._corner(index)
        inset = 0.06 * self._width
        return self._axes(x + inset, y - BAR_TOP_IN - BAR_IN, self._width - 2 * inset, BAR_IN)

    def below(self, index: int) -> tuple[float, float]:
        """Return the middle of a panel's lower edge, in figure coordinates."""
        x, y = self._corner(index)
        return (x + self._width / 2) / PAGE_IN, y / self._height

    def label(self, percentiles: Sequence[float]) -> None:
        """Draw the heading, the key and the note."""
        draw_heading(self.figure, self._lines)
        self._draw_key()
        low, high = percentiles
        text = (
            f"{len(self._shot.why.candidates)} candidates. Colours end at percentiles {low:g} and {high:g}; an arrow "
            f"on a bar: values lie beyond.\n{self._describe_sector()}"
        )
        corner = EDGE_IN / PAGE_IN, 0.05 / self._height
        self.figure.text(*corner, text, va="bottom", fontsize=7, color=INK)

    def _describe_sector(self) -> str:
        scene = self._shot.why.view
        if scene.blockage is None:
            return "No sector blocks the way to the target."
        if view.blockage_seen(self._shot.why, self._box) is None:
            return "The sector that blocks the way to the target lies beyond this view."
        end_number = "1" if np.array_equal(scene.blockage.A, scene.blockage.E1) else "2"
        return (
            f"The blocking sector is outlined at $r$ = {scene.radius:.3g} m. $A$, here "
            f"$E_{end_number}$, is the end of it that is nearer in angle to the target."
        )

    def _draw_key(self) -> None:
        font = {"frameon": False, "fontsize": 7, "labelcolor": INK, "borderaxespad": 0.0, "handlelength": 1.6}
        if not self._has_place:
            anchor = (0.5, (NOTE_IN + 0.02) / self._height)
            draw_key(self.figure, self._key, anchor, "lower center", ncols=KEY_COLUMNS, **font)
            return
        x, y = self._corner(self._rows * self._columns - 1)
        anchor = (x / PAGE_IN, (y + self._tall) / self._height)
        draw_key(self.figure, self._key, anchor, "upper left", labelspacing=0.35, **font)

    def _corner(self, index: int) -> tuple[float, float]:
        """Return the lower left corner of a panel [in]; the grid is centred on the page."""
        row, column = divmod(index, self._columns)
        grid_width = self._columns * (self._width + GAP_IN) - GAP_IN
        x = (PAGE_IN - grid_width) / 2 + column * (self._width + GAP_IN)
        return x, self._height - self._top - row * self._row - TITLE_IN - self._tall

    def _axes(self, x: float, y: float, width: float, height: float) -> Axes:
        return self.figure.add_axes((x / PAGE_IN, y / self._height, width / PAGE_IN, height / self._height))
