"""A picture of a map with the way of the robot that it was made from."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lme.mapping import FREE, OCCUPIED, GridMap
from lme.types import Floats
from runners.figures.parts.style import BLUE, INK, VERMILION, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LONGEST_IN, _MARGIN_IN = 9.0, 0.7
_GREYS = {FREE: 1.0, OCCUPIED: 0.1}
_UNKNOWN_GREY = 0.78


def way_picture(built: GridMap, way: Floats, title: str) -> Figure:
    """The map with the way (N, 2) [m]: free white, obstacles black, unknown grey."""
    width, height = built.size
    scale = _LONGEST_IN / max(width, height)
    figure = new_figure(max(width * scale, 2.5) + _MARGIN_IN, max(height * scale, 1.5) + _MARGIN_IN)
    axes = figure.add_subplot()
    grey = np.full(built.cells.shape, _UNKNOWN_GREY)
    for value, shade in _GREYS.items():
        grey[built.cells == value] = shade
    x, y = built.origin
    extent = (x, x + width, y, y + height)
    axes.imshow(grey, cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=extent, interpolation="nearest")
    axes.plot(*way.T, color=BLUE, linewidth=0.9, label="way of the robot")
    axes.plot(*way[0], "o", color=BLUE, markersize=4, label="its start")
    axes.plot(*way[-1], "s", color=VERMILION, markersize=4, label="its end")
    axes.set_title(f"{title}: {built.free_area:.0f} m² free", fontsize=9, color=INK)
    axes.set_xlabel("x [m]", fontsize=8, color=INK)
    axes.set_ylabel("y [m]", fontsize=8, color=INK)
    axes.tick_params(labelsize=7, colors=INK)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=7.5, labelcolor=INK)
    return figure
