"""A chart of success and the BARN metric over each parameter: one panel each, all on one scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config.escaping import plot_text
from runners.reports.analysis.paired import METRIC, SUCCESS
from runners.reports.analysis.sensitivity import (
    NAME,
    ParameterCurve,
    Point,
    SensitivityStudy,
    factors,
    scored,
)
from runners.reports.figures.style import BLUE, FRAME, GRID, INK, VERMILION, new_figure, save, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS, STUDIES = 4, 3  # of panels; at most: more cannot be read on a page
WIDTH_IN, PANEL_IN, AROUND_IN = 7.2, 1.75, 1.1
FRACTIONS = {0.125: "⅛", 0.25: "¼", 0.5: "½", 0.75: "¾"}
ZERO_GAP = 0.375  # from factor 0 to the least other one, relative to the span of the others
BESIDE = 0.09  # left and right of all factors, relative to their span
TICK_GAP = 0.16  # least gap between two labelled factors, relative to the span of all
_SUCCESS: dict[str, Any] = {"color": BLUE, "linestyle": "-", "linewidth": 1.4, "marker": "o"}
_METRIC: dict[str, Any] = {"color": VERMILION, "linestyle": "--", "linewidth": 1.2, "marker": "s"}
NOTES = (
    "Factor on one parameter, the others kept; its own value in the title. Band: 95 % over worlds, Wilson. "
    "Filled: differs\nfrom that at 1 beyond the noise (paired by world, Holm-adjusted sign-flip p < 0.05). Dashed: "
    "success with all parameters as they are."
)


def sensitivity_figure(studies: Sequence[SensitivityStudy], place: Path) -> list[Path]:
    """Draw a panel for each parameter, save them in `place` as PNG and PDF, and return the paths."""
    shown = studies[:STUDIES]
    columns = min(COLUMNS, max(len(study.curves) for study in shown))
    rows = [math.ceil(len(study.curves) / columns) for study in shown]
    figure = new_figure(WIDTH_IN, AROUND_IN + PANEL_IN * sum(rows) + 0.3 * (len(shown) - 1))
    for part, study, count in zip(
        figure.subfigures(len(shown), 1, squeeze=False, height_ratios=rows)[:, 0], shown, rows, strict=True
    ):
        panels = part.subplots(count, columns, sharex=True, sharey=True, squeeze=False).flat
        places = _places(factors(study.curves))
        for axes, curve in zip(panels, study.curves, strict=False):
            _panel(axes, curve, places)
        for axes in list(panels.base.flat)[len(study.curves) :]:
            axes.set_visible(False)
        part.suptitle(plot_text(f"{study.heading} · {study.place}"), fontsize=9, color=INK, x=0.01, ha="left")
    more = f" {len(studies) - STUDIES} more in {NAME}.md." if len(studies) > STUDIES else ""
    figure.legend(
        handles=_keys(scored(studies)),
        loc="outside upper right",
        ncols=2,
        frameon=False,
        fontsize=8,
        labelcolor=INK,
    )
    figure.supxlabel(NOTES + more, fontsize=7, color=INK, x=0.01, ha="left")
    return save(figure, place / NAME, ("png", "pdf"))


def _panel(axes: Axes, curve: ParameterCurve, places: dict[float, float]) -> None:
    """Draw success with its band, and the BARN metric; factor 0 is apart on the left."""
    _band(axes, curve.points, places)
    rows: list[tuple[str, dict[str, Any]]] = [(SUCCESS, _SUCCESS), (METRIC, _METRIC)]
    for measure, look in rows:
        drawn = [point for point in curve.points if measure in point.row.stats]
        values = [point.row.stats[measure][0] for point in drawn]
        across = [places[point.factor] for point in drawn]
        start = 1 if drawn and drawn[0].factor == 0 else 0
        axes.plot(across[start:], values[start:], zorder=3, **look)
        axes.plot(across[:start], values[:start], zorder=3, **look)
        for point, x, y in zip(drawn, across, values, strict=True):
            face = (
                look["color"] if measure in point.change and point.change[measure].beyond_noise else "white"
            )
            axes.plot(x, y, look["marker"], color=look["color"], markerfacecolor=face, markersize=4, zorder=4)
    axes.axhline(curve.unchanged.success, color=INK, linewidth=0.7, linestyle=(0, (4, 3)), zorder=2)
    axes.axvline(places[1.0], color=INK, linewidth=0.7, linestyle=":", zorder=1)
    value = plot_text(f" = {curve.value}") if curve.value else ""
    axes.set_title(f"{symbol(curve.parameter)}{value}", fontsize=8.5, color=INK, pad=3)
    _plain(axes, places)


def _band(axes: Axes, points: Sequence[Point], places: dict[float, float]) -> None:
    """Draw the interval of the success rates as a band; for factor 0, which is apart, as a bar."""
    bounds = [(places[point.factor], *(point.row.interval or (math.nan, math.nan))) for point in points]
    alone, curve = (bounds[:1], bounds[1:]) if points[0].factor == 0 else ([], bounds)
    x, low, high = zip(*curve, strict=True)
    axes.fill_between(x, low, high, color=BLUE, alpha=0.2, linewidth=0)
    for place, least, most in alone:
        axes.vlines(place, least, most, color=BLUE, alpha=0.3, linewidth=5)


def _places(found: Sequence[float]) -> dict[float, float]:
    """Positions of factors on the axis, log2 of the factor; 0 goes to the left of all others."""
    places = {factor: math.log2(factor) for factor in found if factor > 0}
    left, right = min(places.values()), max(places.values())
    return {**({0.0: left - ZERO_GAP * (right - left or 1.0)} if 0.0 in found else {}), **places}


def _named(places: dict[float, float]) -> list[float]:
    """The factors that get a tick label: 1, the outermost ones, and those that fit between."""
    room = TICK_GAP * (max(places.values()) - min(places.values()))
    named: list[float] = []
    for factor in dict.fromkeys([1.0, *sorted(places)[::-1][:1], *sorted(places)]):
        if all(abs(places[factor] - places[other]) >= room for other in named):
            named.append(factor)
    return sorted(named)


def _plain(axes: Axes, places: dict[float, float]) -> None:
    left, right = min(places.values()), max(places.values())
    beside, named = BESIDE * (right - left), _named(places)
    axes.set(ylim=(-0.03, 1.04), xlim=(left - beside, right + beside), yticks=[0.0, 0.5, 1.0])
    axes.set_xticks(
        [places[factor] for factor in named], [FRACTIONS.get(factor, f"{factor:g}") for factor in named]
    )
    if 0.0 in places:  # the axis is broken between 0 and the least factor
        axes.axvline((left + sorted(places.values())[1]) / 2, color=FRAME, linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, colors=INK, length=2.5)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)


def _keys(with_metric: bool) -> list[Any]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], label=name, markersize=4, markerfacecolor="white", **look)
        for name, look in (("success rate", _SUCCESS), ("BARN metric (at most 0.5)", _METRIC))[
            : 1 + with_metric
        ]
    ]
