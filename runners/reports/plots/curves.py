"""A chart of success and the BARN metric over the values of each changed key, with a line for each system."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config.escaping import plot_text
from runners.reports.analysis.curves import NAME, Curve, CurveStudy
from runners.reports.analysis.paired import METRIC, SUCCESS
from runners.reports.figures.style import (
    BLUE,
    GREEN,
    GRID,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Style,
    new_figure,
    save,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

LOOKS = (
    Style(BLUE, "-", "o"),
    Style(VERMILION, "--", "s"),
    Style(GREEN, "-.", "^"),
    Style(ORANGE, ":", "D"),
    Style(PURPLE, "-", "v"),
    Style(SKY, "--", "P"),
    Style(INK, "-.", "X"),
)
WIDTH_IN, PANEL_IN, AROUND_IN = 7.2, 2.0, 0.9
COLUMNS = 3  # of panels
MEASURES = {SUCCESS: ("success rate", 1.04), METRIC: ("BARN metric", 0.52)}
NOTE = "Band: 95 % interval of the success rate. Only the key below a panel is changed in it."


def curves_figure(studies: Sequence[CurveStudy], place: Path) -> list[Path]:
    """Draw a panel for each key and measure, save them in `place` as PNG and PDF, and return the paths."""
    rows = [row for study in studies for curve in study.curves for _, row in curve.points]
    measures = [name for name in MEASURES if any(name in row.stats for row in rows)]
    columns = min(COLUMNS, len(studies))
    bands = math.ceil(len(studies) / columns)
    figure = new_figure(WIDTH_IN, AROUND_IN + PANEL_IN * bands * len(measures))
    panels = figure.subplots(bands * len(measures), columns, sharey="row", squeeze=False)
    labels = list(dict.fromkeys(curve.label for study in studies for curve in study.curves))
    for number in range(bands * columns):
        for line, measure in enumerate(measures):
            axes = panels[number // columns * len(measures) + line, number % columns]
            if number < len(studies):
                _panel(axes, studies[number], measure, labels, number % columns == 0)
            else:
                axes.set_visible(False)
    handles = [_look(number, label) for number, label in enumerate(labels)]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    figure.supxlabel(f"{plot_text(studies[0].place)}\n{NOTE}", fontsize=7, color=INK, x=0.01, ha="left")
    return save(figure, place / NAME, ("png", "pdf"))


def _panel(axes: Axes, study: CurveStudy, measure: str, labels: Sequence[str], first: bool) -> None:
    for curve in study.curves:
        _line(axes, curve, measure, labels.index(curve.label))
    name, top = MEASURES[measure]
    axes.set(ylim=(-0.02 * top, top))
    axes.set_xticks(study.values, [f"{value:g}" for value in study.values])
    axes.margins(x=0.05)
    axes.autoscale_view()
    axes.set_xlabel(plot_text(study.key), fontsize=8, color=INK)
    if first:
        axes.set_ylabel(name, fontsize=8, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7.5, colors=INK, length=2.5)
    axes.grid(axis="y", color=GRID, linewidth=0.5)


def _line(axes: Axes, curve: Curve, measure: str, number: int) -> None:
    points = [(value, row) for value, row in curve.points if measure in row.stats]
    values = [value for value, _ in points]
    look = _look(number, curve.label)
    look.set_data(values, [row.stats[measure][0] for _, row in points])
    axes.add_line(look)
    if measure == SUCCESS:
        low, high = zip(*(row.interval or (math.nan, math.nan) for _, row in points), strict=True)
        axes.fill_between(values, low, high, color=look.get_color(), alpha=0.12, linewidth=0)


def _look(number: int, label: str) -> Line2D:
    """An empty line in the style of the curve with this number."""
    from matplotlib.lines import Line2D

    colour, line, marker = LOOKS[number % len(LOOKS)]
    look: dict[str, Any] = {"color": colour, "linestyle": line, "marker": marker}
    return Line2D([], [], markersize=4, linewidth=1.3, label=plot_text(label), **look)
