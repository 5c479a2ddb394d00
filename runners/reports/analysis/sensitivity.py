"""The sensitivity study: the change in results when one parameter is multiplied by a factor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from runners.config.escaping import markdown_table, markdown_text, plot_text
from runners.config.job import scale_from_words
from runners.records.launch_record import read_launch
from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS, Block, Difference, signed
from runners.reports.analysis.study import SweepStudy
from runners.reports.analysis.summary import DASH, INTERVAL_NOTE, TIMES, Row
from runners.reports.analysis.tables import TableSetting, picture_titles, shared_setting
from runners.reports.figures.style import (
    BLUE,
    FRAME,
    GRID,
    INK,
    PAGE_IN,
    VERMILION,
    entitle,
    new_figure,
    page_width,
    symbol,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN, UNCHANGED = "scale", ""
NAMES = {SUCCESS: "success", METRIC: "BARN metric"}
NOTES = (
    "Range: the highest minus the lowest success rate over the factors, including 1. Bold: differs from that at 1 "
    "beyond the noise, by the amount in brackets.",
    f"The picture's band: 95 %, {INTERVAL_NOTE}",
)

COLUMNS, STUDIES = 4, 3  # of panels; at most: more cannot be read on a page
PANEL_IN, AROUND_IN = 1.75, 0.4
FRACTIONS = {0.125: "⅛", 0.25: "¼", 0.5: "½", 0.75: "¾"}
ZERO_GAP = 0.375  # from factor 0 to the least other one, relative to the span of the others
BESIDE = 0.09  # left and right of all factors, relative to their span
TICK_GAP = 0.16  # least gap between two labelled factors, relative to the span of all
_SUCCESS: dict[str, Any] = {"color": BLUE, "linestyle": "-", "linewidth": 1.4, "marker": "o"}
_METRIC: dict[str, Any] = {"color": VERMILION, "linestyle": "--", "linewidth": 1.2, "marker": "s"}
CAPTION = (
    "Factor on one parameter, the others kept; its own value in the title. Band: 95 % over worlds, Wilson. "
    "Filled: differs from that at 1 beyond the noise (paired by world, Holm-adjusted sign-flip p < 0.05). Dashed: "
    "success with all parameters as they are."
)


@dataclass(frozen=True, slots=True)
class Point:
    """One factor of one parameter. change: difference from factor 1, by measure; empty at factor 1."""

    factor: float
    row: Row
    change: dict[str, Difference]

    @property
    def success(self) -> float:
        """The success rate."""
        return self.row.stats[SUCCESS][0]


@dataclass(frozen=True, slots=True)
class ParameterCurve:
    """Points of one parameter by increasing factor. value: the parameter at factor 1; empty if unknown."""

    parameter: str
    value: str
    points: tuple[Point, ...]

    @property
    def unchanged(self) -> Point:
        """The point at factor 1."""
        return next(point for point in self.points if point.factor == 1)

    @property
    def range(self) -> float:
        """Largest minus smallest success rate over the factors."""
        rates = [point.success for point in self.points]
        return max(rates) - min(rates)

    def beyond(self, measure: str) -> list[Point]:
        """Return the points whose difference from factor 1 in the measure is beyond the noise."""
        return [
            point for point in self.points if measure in point.change and point.change[measure].beyond_noise
        ]


@dataclass(frozen=True, slots=True)
class SensitivityStudy(SweepStudy):
    """Curves of one system in one setting, in the order of the sweep. heading: the system."""

    name: ClassVar[str] = "sensitivity"
    legend: ClassVar[str] = CAPTION
    heading: str
    setting: TableSetting
    curves: tuple[ParameterCurve, ...]

    @classmethod
    def studies(cls, frame: pd.DataFrame) -> list[Self]:
        """Return one study for each system and setting with both unchanged and multiplied parameters.

        Runs with several multiplied parameters are ignored.
        """
        if COLUMN in frame:
            frame = frame[[len(scale_from_words(text)) <= 1 for text in frame[COLUMN].fillna(UNCHANGED)]]
        studies = [cls._of(block) for block in paired.blocks(frame, COLUMN, UNCHANGED)]
        return [study for study in studies if study.curves]

    @classmethod
    def _of(cls, block: Block) -> Self:
        by_measure = {measure: paired.compare(block, measure) for measure in (SUCCESS, METRIC)}
        base = Point(1.0, paired.row(block.baseline), {})
        # Every curve begins with the point that all share, that at factor 1.
        by_parameter: dict[str, list[Point]] = {}
        for name, frame in block.variants.items():
            ((parameter, factor),) = scale_from_words(name).items()
            change = {measure: changes[name] for measure, changes in by_measure.items() if name in changes}
            by_parameter.setdefault(parameter, [base]).append(Point(factor, paired.row(frame), change))
        curves = (
            ParameterCurve(name, _value(block, name), tuple(sorted(points, key=lambda point: point.factor)))
            for name, points in by_parameter.items()
        )
        return cls(block.heading, shared_setting(block.baseline), tuple(curves))

    @property
    def scored(self) -> bool:
        """Return whether some records have the BARN metric."""
        return any(METRIC in point.row.stats for curve in self.curves for point in curve.points)

    def sentences(self) -> list[str]:
        """Return a line for each parameter, the one with the largest range first."""
        curves = sorted(self.curves, key=lambda curve: -curve.range)
        return [
            f"{self.heading}, {self.setting}: success over the factors of each parameter.",
            *map(_sentence, curves),
        ]

    def tables(self) -> list[str]:
        """Return success rate and BARN metric by factor, then the sentences."""
        measures = (SUCCESS, METRIC) if self.scored else (SUCCESS,)
        return [
            f"**{self.heading} · {self.setting}**",
            *(_table(self, measure) for measure in measures),
            "\n".join(f"- {line}" for line in self.sentences()[1:]),
        ]

    def lines(self) -> Iterator[dict[str, object]]:
        """Yield a line for each point."""
        for curve in self.curves:
            for point in curve.points:
                yield {
                    "block": self.heading,
                    "place": str(self.setting),
                    "parameter": curve.parameter,
                    "value": curve.value,
                    "factor": point.factor,
                    **paired.to_mapping(point.row, point.change),
                }

    def notes(self) -> Sequence[str]:
        """Return the notes, including what a range and a band are."""
        return (*paired.NOTES, *NOTES)

    @classmethod
    def figure(cls, studies: Sequence[Self]) -> Figure:
        """Draw a panel for each parameter, all on one scale."""
        drawn_studies = studies[:STUDIES]
        width = page_width(PAGE_IN)
        most = max(round(COLUMNS * width / PAGE_IN), 1)
        columns = min(most, max(len(study.curves) for study in drawn_studies))
        rows = [math.ceil(len(study.curves) / columns) for study in drawn_studies]
        figure = new_figure(width, AROUND_IN + PANEL_IN * sum(rows) + 0.3 * (len(drawn_studies) - 1))
        # A part of the figure for each study, with a panel for each of its parameters.
        titles, changes = picture_titles(
            [study.setting for study in drawn_studies], [study.heading for study in drawn_studies]
        )
        for subfigure, study, count, heading in zip(
            figure.subfigures(len(drawn_studies), 1, squeeze=False, height_ratios=rows)[:, 0],
            drawn_studies,
            rows,
            titles,
            strict=True,
        ):
            panels = subfigure.subplots(count, columns, sharex=True, sharey=True, squeeze=False).flat
            positions = _positions(factors(study.curves))
            for axes, curve in zip(panels, study.curves, strict=False):
                _panel(axes, curve, positions)
            for axes in list(panels.base.flat)[len(study.curves) :]:
                axes.set_visible(False)
            if len(titles) > 1:
                subfigure.suptitle(plot_text(heading), fontsize=8, color=INK, x=0.01, ha="left")
        figure.legend(
            handles=_keys(any(study.scored for study in studies)),
            loc="outside upper right",
            ncols=2,
            frameon=False,
            fontsize=8,
            labelcolor=INK,
        )
        omitted = [f"{len(studies) - STUDIES} more in {cls.name}.md."] if len(studies) > STUDIES else []
        entitle(figure, titles[0] if len(titles) == 1 else "", "\n".join([CAPTION, *changes, *omitted]))
        return figure


def factors(curves: Sequence[ParameterCurve]) -> list[float]:
    """Return all factors of the curves, increasing."""
    return sorted({point.factor for curve in curves for point in curve.points})


def _value(block: Block, parameter: str) -> str:
    """Return the unchanged value of the parameter; empty if unknown."""
    launch = read_launch(Path(block.baseline["run_dir"].iloc[0])) if "run_dir" in block.baseline else None
    parameters = launch.configs[0]["guide"].get("parameters", {}) if launch is not None else {}
    return str(parameters.get(parameter, ""))


def _sentence(curve: ParameterCurve) -> str:
    rates = [point.success for point in curve.points]
    value = f" ({curve.value})" if curve.value else ""
    # Name the points beyond the noise, such as "success 0.020 at × 0".
    changes = []
    for measure in (SUCCESS, METRIC):
        points = curve.beyond(measure)
        texts = (f"{point.row.stats[measure][0]:.3f} at {TIMES} {point.factor:g}" for point in points)
        changes += [f"{NAMES[measure]} {', '.join(texts)}"] if points else []
    verdict = f"beyond the noise: {'; '.join(changes)}" if changes else "nothing beyond the noise"
    return (
        f"{curve.parameter}{value}: {min(rates):.3f} to {max(rates):.3f}, range {curve.range:.3f}; {verdict}."
    )


def _table(study: SensitivityStudy, measure: str) -> str:
    """Return a table with a line for each parameter and a column for each factor; bold beyond the noise."""
    columns = factors(study.curves)
    lines = [[NAMES[measure], "Value", *(f"{TIMES} {factor:g}" for factor in columns)]]
    lines.append(["---", *["---:"] * (len(columns) + 1)])
    for curve in study.curves:
        cells = {point.factor: _cell(point, measure) for point in curve.points}
        lines.append(
            [
                markdown_text(curve.parameter),
                markdown_text(curve.value) or DASH,
                *(cells.get(factor, DASH) for factor in columns),
            ]
        )
    return markdown_table(lines)


def _cell(point: Point, measure: str) -> str:
    if measure not in point.row.stats:
        return DASH
    text = f"{point.row.stats[measure][0]:.3f}"
    change = point.change.get(measure)
    return f"**{text}** ({signed(change.mean)})" if change and change.beyond_noise else text


def _panel(axes: Axes, curve: ParameterCurve, positions: dict[float, float]) -> None:
    """Draw success with its band, and the BARN metric; factor 0 stands apart on the left."""
    _band(axes, curve.points, positions)
    rows: list[tuple[str, dict[str, Any]]] = [(SUCCESS, _SUCCESS), (METRIC, _METRIC)]
    for measure, style in rows:
        points = [point for point in curve.points if measure in point.row.stats]
        values = [point.row.stats[measure][0] for point in points]
        x_positions = [positions[point.factor] for point in points]
        # Factor 0 has no logarithm, so no line leads to it.
        start = 1 if points and points[0].factor == 0 else 0
        axes.plot(x_positions[start:], values[start:], zorder=3, **style)
        axes.plot(x_positions[:start], values[:start], zorder=3, **style)
        for point, x, y in zip(points, x_positions, values, strict=True):
            face = (
                style["color"] if measure in point.change and point.change[measure].beyond_noise else "white"
            )
            axes.plot(
                x, y, style["marker"], color=style["color"], markerfacecolor=face, markersize=4, zorder=4
            )
    axes.axhline(curve.unchanged.success, color=INK, linewidth=0.7, linestyle=(0, (4, 3)), zorder=2)
    axes.axvline(positions[1.0], color=INK, linewidth=0.7, linestyle=":", zorder=1)
    value = plot_text(f" = {curve.value}") if curve.value else ""
    axes.set_title(f"{symbol(curve.parameter)}{value}", fontsize=8.5, color=INK, pad=3)
    _style_axes(axes, positions)


def _band(axes: Axes, points: Sequence[Point], positions: dict[float, float]) -> None:
    """Draw the interval of the success rates as a band, and as a bar for factor 0, which stands apart."""
    bounds = [(positions[point.factor], *(point.row.interval or (math.nan, math.nan))) for point in points]
    at_zero, curve = (bounds[:1], bounds[1:]) if points[0].factor == 0 else ([], bounds)
    x, low, high = zip(*curve, strict=True)
    axes.fill_between(x, low, high, color=BLUE, alpha=0.2, linewidth=0)
    for x_zero, low_zero, high_zero in at_zero:
        axes.vlines(x_zero, low_zero, high_zero, color=BLUE, alpha=0.3, linewidth=5)


def _positions(all_factors: Sequence[float]) -> dict[float, float]:
    """Return the positions of factors on the axis: log2 of the factor, with 0 to the left of all others."""
    positions = {factor: math.log2(factor) for factor in all_factors if factor > 0}
    left, right = min(positions.values()), max(positions.values())
    return {**({0.0: left - ZERO_GAP * (right - left or 1.0)} if 0.0 in all_factors else {}), **positions}


def _labelled_factors(positions: dict[float, float]) -> list[float]:
    """Return the factors that get a tick label: 1, the outermost ones, and those that fit between."""
    min_gap = TICK_GAP * (max(positions.values()) - min(positions.values()))
    labelled: list[float] = []
    for factor in dict.fromkeys([1.0, *sorted(positions)[::-1][:1], *sorted(positions)]):
        if all(abs(positions[factor] - positions[label]) >= min_gap for label in labelled):
            labelled.append(factor)
    return sorted(labelled)


def _style_axes(axes: Axes, positions: dict[float, float]) -> None:
    left, right = min(positions.values()), max(positions.values())
    margin, labelled = BESIDE * (right - left), _labelled_factors(positions)
    axes.set(ylim=(-0.03, 1.04), xlim=(left - margin, right + margin), yticks=[0.0, 0.5, 1.0])
    axes.set_xticks(
        [positions[factor] for factor in labelled],
        [FRACTIONS.get(factor, f"{factor:g}") for factor in labelled],
    )
    if 0.0 in positions:  # the axis is broken between 0 and the least factor
        axes.axvline((left + sorted(positions.values())[1]) / 2, color=FRAME, linewidth=0.8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8, colors=INK, length=2.5)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)


def _keys(with_metric: bool) -> list[Any]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], label=name, markersize=4, markerfacecolor="white", **style)
        for name, style in (("success rate", _SUCCESS), ("BARN metric (at most 0.5)", _METRIC))[
            : 1 + with_metric
        ]
    ]
