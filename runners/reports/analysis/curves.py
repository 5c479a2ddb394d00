"""Results over the values of a changed key, such as `sim.latency`, with a curve for each system."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from runners.config.escaping import markdown_table, markdown_text, plot_text
from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS
from runners.reports.analysis.study import SweepStudy
from runners.reports.analysis.summary import DASH, Row, as_text, changed_columns, row_keys
from runners.reports.analysis.tables import TableSetting, picture_titles, shared_setting
from runners.reports.figures.style import (
    BLUE,
    GREEN,
    GRID,
    INK,
    ORANGE,
    PAGE_IN,
    PURPLE,
    SKY,
    VERMILION,
    Style,
    entitle,
    new_figure,
    page_width,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

LEAST = 3  # minimum number of values that make a curve
AT = "at"  # name of the column with the key's number
EPISODE = ["world", "run"]
NAMES = {SUCCESS: "success", "collision": "collision", METRIC: "BARN metric"}

LOOKS = (
    Style(BLUE, "-", "o"),
    Style(VERMILION, "--", "s"),
    Style(GREEN, "-.", "^"),
    Style(ORANGE, ":", "D"),
    Style(PURPLE, "-", "v"),
    Style(SKY, "--", "P"),
    Style(INK, "-.", "X"),
)
PANEL_IN, AROUND_IN = 2.0, 0.6
LETTER_IN = 0.07  # of the key
COLUMNS = 3  # of panels
DRAWN = {SUCCESS: ("success rate", 1.04), METRIC: ("BARN metric", 0.52)}
NOTE = "Band: 95 % interval of the success rate. Only the key below a panel is changed in it."


@dataclass(frozen=True, slots=True)
class Curve:
    """A row of figures for each value of the key, in increasing order. label: the system and what else varies."""

    label: str
    points: tuple[tuple[float, Row], ...]


@dataclass(frozen=True, slots=True)
class CurveStudy(SweepStudy):
    """The curves over one key, with all other keys as in the options' files.

    setting: map, robot, worlds and runs.
    """

    name: ClassVar[str] = "curves"
    legend: ClassVar[str] = NOTE
    key: str
    setting: TableSetting
    curves: tuple[Curve, ...]

    @classmethod
    def studies(cls, frame: pd.DataFrame) -> list[Self]:
        """Return a study for each changed key with at least LEAST numbers within a system."""
        keys = [key for key in changed_columns(frame) if _is_curve(frame, key)]
        studies = [cls._of(_runs_of_key(frame, key, keys), key) for key in keys]
        return [study for study in studies if study.curves]

    @classmethod
    def _of(cls, frame: pd.DataFrame, key: str) -> Self:
        keys = ["system", *(name for name in row_keys(frame.drop(columns=AT)) if frame[name].nunique() > 1)]
        texts = frame.assign(**{name: as_text(frame[name]) for name in keys})
        curves = []
        for names, group in texts.groupby(keys, sort=False):
            points = tuple((float(str(value)), paired.row(rows)) for value, rows in group.groupby(AT))
            if len(points) >= LEAST:
                curves.append(Curve(", ".join(str(name) for name in names if name), points))
        return cls(key, shared_setting(frame), tuple(curves))

    @property
    def values(self) -> list[float]:
        """All values of the key, increasing."""
        return sorted({value for curve in self.curves for value, _ in curve.points})

    def sentences(self) -> list[str]:
        """Return a line for each curve: success at the smallest and the largest value of the key."""
        lines = []
        for curve in self.curves:
            (smallest, row_smallest), (largest, row_largest) = curve.points[0], curve.points[-1]
            lines.append(
                f"{curve.label}: success {row_smallest.stats[SUCCESS][0]:.3f} at {self.key}={smallest:g}, "
                f"{row_largest.stats[SUCCESS][0]:.3f} at {largest:g}."
            )
        return lines

    def tables(self) -> list[str]:
        """Return a table for each measure, with a line for each curve and a column for each value."""
        return [f"**{markdown_text(f'{self.key} · {self.setting}')}**", *_tables(self)]

    def lines(self) -> Iterator[dict[str, object]]:
        """Yield a line for each point."""
        for curve in self.curves:
            for value, row in curve.points:
                yield {"key": self.key, "value": value, "curve": curve.label, **paired.to_mapping(row, {})}

    def notes(self) -> Sequence[str]:
        """Return nothing: the tables compare nothing."""
        return ()

    @classmethod
    def figure(cls, studies: Sequence[Self]) -> Figure:
        """Draw a panel for each key and measure, with a line for each system."""
        rows = [row for study in studies for curve in study.curves for _, row in curve.points]
        measures = [name for name in DRAWN if any(name in row.stats for row in rows)]
        width = page_width(PAGE_IN)
        columns = min(max(round(COLUMNS * width / PAGE_IN), 1), len(studies))
        bands = math.ceil(len(studies) / columns)
        figure = new_figure(width, AROUND_IN + PANEL_IN * bands * len(measures))
        panels = figure.subplots(bands * len(measures), columns, sharey="row", squeeze=False)
        labels = list(dict.fromkeys(curve.label for study in studies for curve in study.curves))
        for number in range(bands * columns):
            for line, measure in enumerate(measures):
                axes = panels[number // columns * len(measures) + line, number % columns]
                if number < len(studies):
                    _panel(axes, studies[number], measure, labels, number % columns == 0)
                else:
                    axes.set_visible(False)
        handles = [_curve_line(number, label) for number, label in enumerate(labels)]
        longest = max(map(len, labels))
        entries = max(int(width / (0.55 + LETTER_IN * longest)), 1)
        figure.legend(handles=handles, loc="outside upper left", ncols=entries, frameon=False, fontsize=8)
        (heading, *_), changes = picture_titles([study.setting for study in studies], [""] * len(studies))
        entitle(figure, heading, "\n".join([NOTE, *changes]))
        return figure


def _is_curve(frame: pd.DataFrame, key: str) -> bool:
    """Return whether some system has at least LEAST numbers for the key."""
    values = _numbers(frame[key])
    return bool(values.notna().all() and values.groupby(frame["system"]).nunique().max() >= LEAST)


def _runs_of_key(frame: pd.DataFrame, key: str, keys: Sequence[str]) -> pd.DataFrame:
    """Return the records in which the other keys are as usual, each episode once, with the key's number as AT."""
    # Keep the runs in which this key alone is varied, and drop the columns of all others.
    other_keys = [config_key for config_key in keys if config_key != key]
    changed_keys = frame["changes"].map(
        lambda text: {change.partition("=")[0] for change in text.split(", ")}
    )
    is_usual = np.ones(len(frame), np.bool_)
    for other in other_keys:
        # Unchanged, or what most runs have if all of them change it, as those of one experiment do.
        is_unchanged = np.array([other not in names for names in changed_keys])
        values = frame[other]
        is_usual &= is_unchanged if is_unchanged.any() else (values == values.mode().iloc[0]).to_numpy()
    subset = frame[is_usual]
    subset = subset.drop(columns=[*other_keys, "changes", "run_dir"]).assign(**{AT: _numbers(subset[key])})
    # The same episode may have been driven in several runs: keep the first.
    settings = [name for name in ("system", *row_keys(subset), *EPISODE) if name != key]
    return subset.drop(columns=key)[~subset.duplicated([AT, *settings])]


def _numbers(column: pd.Series) -> pd.Series:
    import pandas as pd

    return pd.to_numeric(column, errors="coerce")


def _tables(study: CurveStudy) -> Iterator[str]:
    for measure, name in NAMES.items():
        if not any(measure in row.stats for curve in study.curves for _, row in curve.points):
            continue
        lines = [[name, *(f"{value:g}" for value in study.values)], ["---", *["---:"] * len(study.values)]]
        for curve in study.curves:
            rows = dict(curve.points)
            means = {value: row.stats[measure][0] for value, row in rows.items() if measure in row.stats}
            cells = (f"{means[v]:.3f}" if v in means else DASH for v in study.values)
            lines.append([markdown_text(curve.label), *cells])
        yield markdown_table(lines)


def _panel(axes: Axes, study: CurveStudy, measure: str, labels: Sequence[str], is_first: bool) -> None:
    for curve in study.curves:
        _line(axes, curve, measure, labels.index(curve.label))
    name, top = DRAWN[measure]
    axes.set(ylim=(-0.02 * top, top))
    axes.set_xticks(study.values, [f"{value:g}" for value in study.values])
    axes.margins(x=0.05)
    axes.autoscale_view()
    axes.set_xlabel(plot_text(study.key), fontsize=8, color=INK)
    if is_first:
        axes.set_ylabel(name, fontsize=8, color=INK)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7.5, colors=INK, length=2.5)
    axes.grid(axis="y", color=GRID, linewidth=0.5)


def _line(axes: Axes, curve: Curve, measure: str, number: int) -> None:
    points = [(value, row) for value, row in curve.points if measure in row.stats]
    values = [value for value, _ in points]
    line = _curve_line(number, curve.label)
    line.set_data(values, [row.stats[measure][0] for _, row in points])
    axes.add_line(line)
    if measure == SUCCESS:
        low, high = zip(*(row.interval or (math.nan, math.nan) for _, row in points), strict=True)
        axes.fill_between(values, low, high, color=line.get_color(), alpha=0.12, linewidth=0)


def _curve_line(number: int, label: str) -> Line2D:
    """Return an empty line in the style of the curve with this number."""
    from matplotlib.lines import Line2D

    colour, line, marker = LOOKS[number % len(LOOKS)]
    style: dict[str, Any] = {"color": colour, "linestyle": line, "marker": marker}
    return Line2D([], [], markersize=4, linewidth=1.3, label=plot_text(label), **style)
