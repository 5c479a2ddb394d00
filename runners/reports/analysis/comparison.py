"""Comparison of systems: a chart of outcomes and BARN metric, and paired differences from the reference system.

The chart shows the published results, too. The reference is LME, or the system driven first if LME was not driven.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from runners.config.escaping import plot_text
from runners.reports.analysis import paired, published
from runners.reports.analysis.paired import Block, Difference, interval, signed
from runners.reports.analysis.study import SweepStudy, worst_and_best
from runners.reports.analysis.summary import (
    DASH,
    INTERVAL_HEADER,
    INTERVAL_NOTE,
    METRICS,
    SETTING,
    SMOOTHNESS,
    Row,
    as_text,
    row_keys,
    usual,
)
from runners.reports.analysis.tables import TableSetting, changed_notes, driven, shared_setting
from runners.reports.analysis.text_table import Strong, TextTable
from runners.reports.figures.style import (
    GRID,
    INK,
    OUTCOMES,
    PAGE_IN,
    SKY,
    entitle,
    filled,
    new_figure,
    outcome_keys,
    page_width,
    save,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


REFERENCE = "LME"
SEED, WEIGHTS = "seed", "weights"
MEASURES = (paired.SUCCESS, paired.METRIC, SMOOTHNESS)
HEADERS = {metric.key: metric.header for metric in METRICS if metric.key in MEASURES}
ROW = "row"  # a column of the records: the row's name in the table
ROW_IN, LINE_IN, AROUND_IN = 0.3, 0.135, 0.85  # heights of a row, of a line of its name, and of all besides
LETTERS_PER_IN = 5.0  # of the names beside the bars, which take a third of the page
THICK, THIN = 0.8, 0.42  # height of our bars, of published bars
FADED = 0.45  # opacity of published bars
MOST = 60  # most bars on a page


@dataclass(frozen=True, slots=True)
class Comparison(SweepStudy):
    """Differences of the other rows from the reference's row, in one setting. Its picture is the chart of the table.

    reference: its row's name in the table. changes: by row and measure. rows: all, the reference's first. driven:
    seeds and versions.
    """

    name: ClassVar[str] = "comparison"
    reference: str
    setting: TableSetting
    rows: Mapping[str, Row]
    changes: Mapping[str, Mapping[str, Difference]]
    driven: str

    @classmethod
    def studies(cls, frame: pd.DataFrame) -> list[Self]:
        """Return one comparison for each setting in which the reference and another system were driven.

        A setting is a combination of robot, map, subset, seed and whatever else varies within the reference system.
        """
        systems = list(dict.fromkeys(frame["system"]))
        reference = REFERENCE if REFERENCE in systems else systems[0]
        of_reference = frame["system"] == reference
        keys = [key for key in row_keys(frame) if key != WEIGHTS or not _trained_by_seed(frame, of_reference)]
        settings = [key for key in keys if key in SETTING or as_text(frame[key][of_reference]).nunique() > 1]
        names = _names(frame, [key for key in keys if key not in settings])
        baseline = names[of_reference].iloc[0]
        blocks = paired.blocks(frame.assign(**{ROW: names}), ROW, baseline, settings)
        return [cls._of(block, baseline) for block in blocks]

    @classmethod
    def _of(cls, block: Block, reference: str) -> Self:
        import pandas as pd

        by_measure = {measure: paired.compare(block, measure) for measure in MEASURES}
        frames = {reference: block.baseline, **block.variants}
        frame = pd.concat(frames.values())
        setting = shared_setting(frame)
        if block.heading:
            setting = setting._replace(place=(block.heading, *setting.place))
        return cls(
            reference,
            setting,
            {name: paired.row(frame) for name, frame in frames.items()},
            {
                name: {measure: changes[name] for measure, changes in by_measure.items() if name in changes}
                for name in block.variants
            },
            driven(frame),
        )

    def sentences(self) -> list[str]:
        """Return a line for each row other than the reference's."""
        return [
            f"Paired differences from {self.reference}, {self.setting}:",
            *(
                f"{name}: {'; '.join(_describe_change(key, change) for key, change in changes.items())}."
                if changes
                else f"{name}: no episode in common."
                for name, changes in self.changes.items()
            ),
        ]

    def tables(self) -> list[str]:
        """Return a table with a line for each row other than the reference's."""
        return [f"**{self.setting}**", _table(self).to_markdown()]

    def to_latex(self, label: str) -> str:
        """Return the same table in LaTeX."""
        caption = f"Differences from {self.reference}: {self.setting}, {self.driven}. {paired.TEST}"
        return _table(self).to_latex(label, caption)

    def lines(self) -> Iterator[dict[str, object]]:
        """Yield a line for each row."""
        for name, row in self.rows.items():
            changes = paired.to_mapping(row, self.changes.get(name, {}))
            yield {"place": str(self.setting), "reference": self.reference, "row": name, **changes}


def _trained_by_seed(frame: pd.DataFrame, of_reference: pd.Series) -> bool:
    """Return whether the reference has other weights for another seed, and no system several for one seed.

    So it is after `lme train -m system=… seed=0,1`. The weights then belong to the seed, and systems are compared seed
    by seed.
    """
    if not {SEED, WEIGHTS} <= set(frame) or frame[WEIGHTS][of_reference].nunique() < 2:
        return False
    trainings = frame[["system", SEED, WEIGHTS]].drop_duplicates()
    return not bool(trainings.duplicated(["system", SEED]).any())


def _names(frame: pd.DataFrame, keys: list[str]) -> pd.Series:
    """Return the name of each record: its system, and the values of keys in which records differ, unless usual."""
    names = as_text(frame["system"])
    for key in keys:
        values = as_text(frame[key])
        if values.nunique() > 1:
            names = names + (f", {key} " + values).where(~values.isin(usual(key)), "")
    return names


def _describe_change(measure: str, change: Difference) -> str:
    interval_text = interval(change)
    text = f"{HEADERS[measure]} {signed(change.mean)}" + (f" ({interval_text})" if interval_text else "")
    return f"{text}, beyond the noise" if change.beyond_noise else text


def _table(study: Comparison) -> TextTable:
    has_metric = any(paired.METRIC in row.stats for row in study.rows.values())
    measures = [measure for measure in MEASURES if measure != paired.METRIC or has_metric]
    header = [f"Difference from {study.reference}"]
    for measure in measures:
        header += [HEADERS[measure], "95 %", "p (Holm)"]
    lines = [_cells(name, changes, measures) for name, changes in study.changes.items()]
    return TextTable([*header, "Pairs"], lines)


def _cells(name: str, changes: Mapping[str, Difference], measures: Sequence[str]) -> list[str]:
    cells = [name]
    for measure in measures:
        cells += _change(changes.get(measure))
    return [*cells, str(max((change.pairs for change in changes.values()), default=0))]


def _change(change: Difference | None) -> list[str]:
    """Return the difference, bold if it exceeds the noise, its interval and p."""
    if change is None:
        return [DASH] * 3
    mean = signed(change.mean)
    return [
        Strong(mean) if change.beyond_noise else mean,
        interval(change) or DASH,
        paired.p_value(change) or DASH,
    ]


def comparison_figure(frame: pd.DataFrame, rows: Sequence[Row], directory: Path) -> list[Path]:
    """Draw one bar per row of the table, save the chart in `directory` as PNG and PDF, and return the paths.

    frame: one row per episode. Of more than `MOST` rows the best and the worst are drawn.
    """
    drawn_rows = best_and_worst(rows)
    figure = chart(drawn_rows)
    shared = {key: value for key, value in _shared_keys(drawn_rows).items() if value not in usual(key)}
    heading = " · ".join([shared_setting(frame).short, *(f"{key} {value}" for key, value in shared.items())])
    entitle(figure, heading, "\n".join(chart_notes(drawn_rows, len(rows))))
    return save(figure, directory / Comparison.name, ("png", "pdf"))


def chart(rows: Sequence[Row]) -> Figure:
    """Return a chart with a bar per row and a key."""
    has_metric = any(paired.METRIC in row.stats for row in rows)
    shared = _shared_keys(rows)
    names = [_bar_label(row, shared) for row in rows]
    row_in = max(ROW_IN, LINE_IN * (2 + max(name.count("\n") for name in names)))
    figure = new_figure(page_width(PAGE_IN), AROUND_IN + row_in * len(rows))
    widths = [3.0, 1.4] if has_metric else [1.0]
    panels = figure.subplots(1, len(widths), sharey=True, squeeze=False, width_ratios=widths)[0]
    _draw_outcomes(panels[0], rows)
    if has_metric:
        _draw_metric(panels[1], rows)
    # Name the rows, and say what the colours are.
    panels[0].set_yticks(range(len(rows)), names, fontsize=8, color=INK)
    panels[0].set_ylim(len(rows) - 0.4, -0.6)
    figure.legend(
        handles=outcome_keys(), loc="outside upper right", ncols=3, frameon=False, fontsize=8, labelcolor=INK,
        handlelength=1.5, columnspacing=1.2, handletextpad=0.5,
    )  # fmt: skip
    return figure


def best_and_worst(rows: Sequence[Row]) -> list[Row]:
    """Return at most `MOST` of the rows, in their order: as many best as worst ones, by metric and success."""

    def score(row: Row) -> list[float]:
        means = (row.stats.get(name, (math.nan, math.nan))[0] for name in (paired.METRIC, "success"))
        return [-math.inf if math.isnan(mean) else mean for mean in means]

    return worst_and_best(rows, score, MOST)


def _draw_outcomes(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw stacked bars of the outcomes, with the interval of the success rate that the table gives."""
    # Stack the outcomes from the left; the rate is written on the success.
    for line, row in enumerate(rows):
        left = 0.0
        for outcome in OUTCOMES:
            share, _ = row.stats.get(outcome, (0.0, math.nan))
            axes.barh(line, share, left=left, height=_bar_height(row), alpha=_opacity(row), **filled(outcome))
            if outcome == "success":
                _write_value(axes, line, share)
            left += share
        if row.interval is not None:
            _draw_whisker(axes, line, *row.interval)
    axes.set(xlim=(0.0, 1.0))
    axes.set_xlabel("share of episodes", fontsize=8.5, color=INK)
    _style_axes(axes)


def _draw_metric(axes: Axes, rows: Sequence[Row]) -> None:
    for line, row in enumerate(rows):
        mean, _ = row.stats.get(paired.METRIC, (math.nan, math.nan))
        if not math.isnan(mean):
            axes.barh(line, mean, height=_bar_height(row), color=SKY, alpha=_opacity(row))
            _write_value(axes, line, mean)
    axes.set(xlim=(0.0, 0.52))
    axes.set_xlabel("BARN metric\n(at most 0.5)", fontsize=8.5, color=INK)
    _style_axes(axes)


def _write_value(axes: Axes, line: int, mean: float) -> None:
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
        path_effects=[withStroke(linewidth=2.5, foreground="white", alpha=0.8)],
        zorder=6,  # above the whisker
    )


def _draw_whisker(axes: Axes, line: int, low: float, high: float) -> None:
    """Draw an interval across the bars, in ink on white so that it can be seen on every colour."""
    for colour, wider in (("white", 1.6), (INK, 0.0)):
        axes.plot(
            [low, high], [line, line], "|-", color=colour, clip_on=False, zorder=5,
            linewidth=0.9 + wider, markersize=5 + wider, markeredgewidth=0.9 + wider,
        )  # fmt: skip


def chart_notes(rows: Sequence[Row], num_rows: int) -> list[str]:
    """Return the notes on the rows shown. num_rows: number of rows in the table."""
    lines = []
    if len(rows) < num_rows:
        half = len(rows) // 2
        lines.append(f"The {half} best and the {half} worst of {num_rows:,} rows; the table has all.")
    if any(row.global_planner != "no" for row in rows):
        lines.append("* with a global planner.")
    if any(row.interval is not None for row in rows):
        lines.append(f"Whiskers: {INTERVAL_HEADER}. {INTERVAL_NOTE}")
    return [*lines, *changed_notes(rows), *published.notes(rows)]


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


def _bar_label(row: Row, shared: Container[str]) -> str:
    """Return the name of a row with its keys, without those that all share and without usual values."""
    keys = {key: value for key, value in row.keys.items() if key not in shared and value not in usual(key)}
    if row.ablated:
        keys.pop("ablation", None)  # the name says it
    texts = [row.name, *(f"{key} {value}" for key, value in keys.items())]
    text = f" {DASH} ".join(texts) + ("" if row.global_planner == "no" else " *")
    return plot_text("\n".join(textwrap.wrap(text, int(LETTERS_PER_IN * page_width(PAGE_IN)))))


def _bar_height(row: Row) -> float:
    return THIN if row.published_map else THICK


def _opacity(row: Row) -> float:
    return FADED if row.published_map else 1.0


def _style_axes(axes: Axes) -> None:
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(axis="x", labelsize=8, colors=INK)
    axes.grid(axis="x", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
