"""A chart of several systems: outcomes and BARN metric, next to published results."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from runners.config.escaping import plot_text
from runners.reports.analysis import published
from runners.reports.analysis.summary import DASH, INTERVAL_HEADER, INTERVAL_NOTE, Row, usual
from runners.reports.analysis.tables import title
from runners.reports.figures.style import GRID, HATCHES, INK, OUTCOMES, SKY, STYLES, new_figure, save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "comparison"
METRIC = "barn_metric"
WIDTH_IN, ROW_IN, AROUND_IN = 9.0, 0.3, 1.75
THICK, THIN = 0.8, 0.42  # height of our bars, of published bars
FADED = 0.45  # opacity of published bars
MOST = 60  # most bars on a page


def comparison_figure(frame: pd.DataFrame, rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw one bar per row of the table, save the chart in `directory` as PNG and PDF, and return the paths.

    frame: one row per episode. Of more than `MOST` rows the best and the worst are drawn.
    """
    has_metric = any(METRIC in row.stats for row in rows)
    num_rows, rows = len(rows), best_and_worst(rows)
    figure = new_figure(WIDTH_IN, AROUND_IN + ROW_IN * len(rows))
    widths = [3.0, 1.4] if has_metric else [1.0]
    panels = figure.subplots(1, len(widths), sharey=True, squeeze=False, width_ratios=widths)[0]
    _outcomes(panels[0], rows)
    if has_metric:
        _metric(panels[1], rows)
    _label(figure, panels[0], rows, num_rows, title(frame))
    return save(figure, directory / NAME, ("png", "pdf"))


def best_and_worst(rows: Sequence[Row]) -> list[Row]:
    """Return at most `MOST` of the rows, in their order: as many best as worst ones, by metric and success."""

    def score(line: int) -> list[float]:
        means = (rows[line].stats.get(name, (math.nan, math.nan))[0] for name in (METRIC, "success"))
        return [-math.inf if math.isnan(mean) else mean for mean in means]

    # Half of the bars for each end of the ranking, in the order of the table.
    ranked = sorted(range(len(rows)), key=score)
    extremes = ranked if len(rows) <= MOST else ranked[: MOST // 2] + ranked[-MOST // 2 :]
    return [rows[line] for line in sorted(extremes)]


def _outcomes(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw stacked bars of the outcomes, with the interval of the success rate that the table gives."""
    # Stack the outcomes from the left; the rate is written on the success.
    for line, row in enumerate(rows):
        left = 0.0
        for outcome in OUTCOMES:
            share, _ = row.stats.get(outcome, (0.0, math.nan))
            axes.barh(
                line,
                share,
                left=left,
                height=_height(row),
                color=STYLES[outcome].colour,
                alpha=_opacity(row),
                hatch=HATCHES.get(outcome),
                edgecolor="white",
                linewidth=0.4,
            )
            if outcome == "success":
                _value(axes, line, share)
            left += share
        if row.interval is not None:
            _whisker(axes, line, *row.interval)
    axes.set(xlim=(0.0, 1.0))
    axes.set_xlabel("share of episodes", fontsize=8.5, color=INK)
    _style_axes(axes)


def _metric(axes: Axes, rows: Sequence[Row]) -> None:
    for line, row in enumerate(rows):
        mean, _ = row.stats.get(METRIC, (math.nan, math.nan))
        if not math.isnan(mean):
            axes.barh(line, mean, height=_height(row), color=SKY, alpha=_opacity(row))
            _value(axes, line, mean)
    axes.set(xlim=(0.0, 0.52))
    axes.set_xlabel("BARN metric\n(at most 0.5)", fontsize=8.5, color=INK)
    _style_axes(axes)


def _value(axes: Axes, line: int, mean: float) -> None:
    """Write the mean at the foot of its bar."""
    from matplotlib.patheffects import withStroke

    axes.annotate(
        f"{mean:.3f}",
        (0.0, line),
        (3, 0),
        textcoords="offset points",
        va="center",
        fontsize=7.5,
        color=INK,
        path_effects=[withStroke(linewidth=2.0, foreground="white", alpha=0.6)],
    )


def _whisker(axes: Axes, line: int, low: float, high: float) -> None:
    """Draw an interval across the bars, in ink on white so that it can be seen on every colour."""
    for colour, wider in (("white", 1.6), (INK, 0.0)):
        axes.plot(
            [low, high], [line, line], "|-", color=colour, clip_on=False, zorder=5,
            linewidth=0.9 + wider, markersize=5 + wider, markeredgewidth=0.9 + wider,
        )  # fmt: skip


def _label(figure: Figure, axes: Axes, rows: Sequence[Row], num_rows: int, heading: str) -> None:
    """Write the names of the rows, the heading and the key above, and the notes below. num_rows: rows of the table."""
    from matplotlib.patches import Patch

    shared = _shared_keys(rows)
    axes.set_yticks(range(len(rows)), [_name(row, shared) for row in rows], fontsize=8, color=INK)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    keys = [
        Patch(
            facecolor=STYLES[kind].colour,
            hatch=HATCHES.get(kind),
            edgecolor="white",
            linewidth=0.4,
            label=kind,
        )
        for kind in OUTCOMES
    ]
    figure.legend(handles=keys, loc="outside upper right", ncols=3, frameon=False, fontsize=8, labelcolor=INK)
    heading = " · ".join(
        [heading, *(f"{key} {value}" for key, value in shared.items() if value not in usual(key))]
    )
    figure.suptitle(plot_text(heading), fontsize=10.5, color=INK, x=0.01, ha="left")
    figure.supxlabel(plot_text("\n".join(_notes(rows, num_rows))), fontsize=7, color=INK, x=0.01, ha="left")


def _notes(rows: Sequence[Row], num_rows: int) -> list[str]:
    """Return the notes on the rows shown. num_rows: number of rows in the table."""
    lines = []
    if len(rows) < num_rows:
        half = len(rows) // 2
        lines.append(f"The {half} best and the {half} worst of {num_rows:,} rows; the table has all.")
    if any(row.global_planner != "no" for row in rows):
        lines.append("* with a global planner.")
    if any(row.interval is not None for row in rows):
        lines.append(f"Whiskers: {INTERVAL_HEADER}. {INTERVAL_NOTE}")
    return lines + published.notes(rows)


def _shared_keys(rows: Sequence[Row]) -> dict[str, str]:
    """Return the keys with a single value over several rows of ours."""
    driven_keys = [row.keys for row in rows if not row.published_map]
    if len(driven_keys) < 2:
        return {}
    return {
        key: value
        for key, value in driven_keys[0].items()
        if all(keys.get(key) == value for keys in driven_keys)
    }


def _name(row: Row, shared: Container[str]) -> str:
    """Return the name of a row with its keys, without those that all share and without usual values."""
    keys = {key: value for key, value in row.keys.items() if key not in shared and value not in usual(key)}
    texts = [row.name, *(f"{key} {value}" for key, value in keys.items())]
    return plot_text(f" {DASH} ".join(texts)) + ("" if row.global_planner == "no" else " *")


def _height(row: Row) -> float:
    return THIN if row.published_map else THICK


def _opacity(row: Row) -> float:
    return FADED if row.published_map else 1.0


def _style_axes(axes: Axes) -> None:
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=8, colors=INK)
    axes.grid(axis="x", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
