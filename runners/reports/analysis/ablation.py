"""The ablation study: what each part of the method contributes, and whether that agrees with the paper."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from runners.config.escaping import markdown_text, plot_text
from runners.reports.analysis import paired
from runners.reports.analysis.ablation_claims import (
    CLAIMS,
    COMPLETE,
    NOTES,
    is_the_papers,
    removed_parts,
    variant_label,
    verdict_on,
)
from runners.reports.analysis.paired import METRIC, SUCCESS, Block, Difference, interval, signed
from runners.reports.analysis.study import SweepStudy
from runners.reports.analysis.summary import DASH, INTERVAL_HEADER, INTERVAL_NOTE, Row
from runners.reports.analysis.tables import TableSetting, driven, picture_titles, shared_setting
from runners.reports.analysis.text_table import Strong, TextTable
from runners.reports.figures.style import (
    GRID,
    INK,
    OUTCOMES,
    PAGE_IN,
    entitle,
    filled,
    new_figure,
    outcome_keys,
    page_width,
    symbol,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN = "ablation"
_BEYOND, _STATEMENT = "Beyond the noise", ("The paper says", "Agrees")  # columns
STUDY_IN, AROUND_IN = 3.6, 0.35
VARIANT_IN = 0.8  # least width of a variant; many variants widen the figure
STUDIES = 4  # at most: more cannot be read on a page
BAR = 0.72
LETTERS = 11  # in a line of a variant's name
GAP = 0.08  # between panels, in panels
CAPTION = (
    f"Whiskers above: {INTERVAL_HEADER}. {INTERVAL_NOTE}\n"
    "Below: difference in success to the complete method, paired by world and run, 95 % bootstrap over worlds; filled "
    "where beyond the noise (Holm-adjusted sign-flip p < 0.05)."
)


@dataclass(frozen=True, slots=True)
class Variant:
    """A line of the table. change: difference from the complete method, by measure; empty for the complete method.

    claim: the paper's statement. agrees: "yes", "in part", "no" or "open". words: a sentence with the reason. All
    three are empty if the paper makes no statement.
    """

    ablation: str
    row: Row
    change: dict[str, Difference]
    claim: str = ""
    agrees: str = ""
    words: str = ""

    @property
    def label(self) -> str:
        """The name in tables: "No c_o" for a shipped ablation, and the label of any other, "With few candidates"."""
        return variant_label(self.ablation, self.row.ablated)


@dataclass(frozen=True, slots=True)
class AblationStudy(SweepStudy):
    """Variants of one system in one setting, the complete one first. heading: the system. driven: seeds, versions."""

    name: ClassVar[str] = "ablation"
    legend: ClassVar[str] = CAPTION
    heading: str
    setting: TableSetting
    variants: tuple[Variant, ...]
    driven: str

    @classmethod
    def studies(cls, frame: pd.DataFrame) -> list[Self]:
        """Return one study for each system and setting with the complete method and an ablation.

        Other records are ignored.
        """
        return [cls._of(block) for block in paired.blocks(frame, COLUMN, COMPLETE)]

    @classmethod
    def _of(cls, block: Block) -> Self:
        import pandas as pd

        by_measure = {measure: paired.compare(block, measure) for measure in (SUCCESS, METRIC)}
        claims = CLAIMS if is_the_papers(block) else {}
        # Variants in the order of the paper, then all others by name.
        names = [
            *(name for name in CLAIMS if name in block.variants),
            *sorted(block.variants.keys() - CLAIMS.keys()),
        ]
        variants = [Variant(COMPLETE, paired.row(block.baseline), {})]
        # Judge each variant about which the paper makes a statement.
        for name in names:
            change = {measure: changes[name] for measure, changes in by_measure.items() if name in changes}
            verdict = verdict_on(name, by_measure[SUCCESS], claims) if name in claims else None
            claim = claims[name].words if verdict else ""
            variants.append(Variant(name, paired.row(block.variants[name]), change, claim, *(verdict or ())))
        frame = pd.concat([block.baseline, *block.variants.values()])
        return cls(block.heading, shared_setting(block.baseline), tuple(variants), driven(frame))

    @property
    def judged(self) -> list[Variant]:
        """Variants about which the paper makes a statement."""
        return [variant for variant in self.variants if variant.agrees]

    def sentences(self) -> list[str]:
        """Return a line for each of the paper's statements: whether our results agree with it."""
        lines = [f"{variant.label}: {variant.words}" for variant in self.judged]
        return [f"{self.heading}, {self.setting}: the paper's ablation and ours.", *lines] if lines else []

    def tables(self) -> list[str]:
        """Return the table, and a list of verdicts if there are any."""
        lines = (f"- {markdown_text(variant.label)}: {variant.words}" for variant in self.judged)
        verdicts = "\n".join(lines)
        heading = f"**{markdown_text(f'{self.heading} · {self.setting}')}**"
        return [heading, _table(self).to_markdown(), *([verdicts] if verdicts else ())]

    def to_latex(self, label: str) -> str:
        """Return the differences from the complete method in LaTeX, without the paper's statements."""
        caption = f"Ablation of {self.heading}: {self.setting}, {self.driven}. {paired.TEST}"
        return _table(self).without(_BEYOND, *_STATEMENT).to_latex(label, caption)

    def lines(self) -> Iterator[dict[str, object]]:
        """Yield a line for each variant."""
        for variant in self.variants:
            yield {
                "block": self.heading,
                "place": str(self.setting),
                "ablation": variant.ablation,
                **({"pairs": variant.change[SUCCESS].pairs} if variant.change else {}),
                **paired.to_mapping(variant.row, variant.change),
                "paper_says": variant.claim,
                "agrees": variant.agrees,
            }

    def notes(self) -> Sequence[str]:
        """Return the notes, including how verdicts are found if there are any."""
        return (*paired.NOTES, *(NOTES if self.judged else ()))

    @classmethod
    def figure(cls, studies: Sequence[Self]) -> Figure:
        """Draw outcomes and paired differences of every variant."""
        drawn_studies = studies[:STUDIES]
        most = max(len(study.variants) for study in drawn_studies)
        width = page_width(max(PAGE_IN, VARIANT_IN * (1 + most)))
        figure = new_figure(width, AROUND_IN + STUDY_IN * len(drawn_studies))
        panels = figure.subplots(
            2 * len(drawn_studies),
            1,
            squeeze=False,
            height_ratios=[1.6, 1.0] * len(drawn_studies),
            gridspec_kw={"hspace": GAP},
        )[:, 0]
        titles, changes = picture_titles(
            [study.setting for study in drawn_studies], [study.heading for study in drawn_studies]
        )
        # Two panels for each study: the outcomes above, the differences below.
        for number, study in enumerate(drawn_studies):
            upper_axes, lower_axes = panels[2 * number : 2 * number + 2]
            _outcomes(upper_axes, study.variants)
            _changes(lower_axes, study.variants)
            if len(drawn_studies) > 1:
                upper_axes.set_title(plot_text(titles[number]), fontsize=8, color=INK, loc="left")
        figure.legend(
            handles=outcome_keys(),
            loc="outside upper right",
            ncols=3,
            frameon=False,
            fontsize=8,
            labelcolor=INK,
        )
        omitted = [f"{len(studies) - STUDIES} more in {cls.name}.md."] if len(studies) > STUDIES else []
        entitle(figure, titles[0] if len(titles) == 1 else "", "\n".join([CAPTION, *changes, *omitted]))
        return figure


def _table(study: AblationStudy) -> TextTable:
    change = ["Difference", "95 %", "p (Holm)", _BEYOND]
    has_metric = any(METRIC in variant.row.stats for variant in study.variants)
    measures = {SUCCESS: "Success", METRIC: "BARN metric"} if has_metric else {SUCCESS: "Success"}
    columns = [column for name in measures.values() for column in (name, *change)]
    header = ["Variant", *columns, *_STATEMENT, "Pairs"]
    lines = [_cells(variant, list(measures)) for variant in study.variants]
    return TextTable(header, lines, left=(0, *map(header.index, _STATEMENT)))


def _cells(variant: Variant, measures: Sequence[str]) -> list[str]:
    unfinished = f", {variant.row.unfinished}" if variant.row.unfinished else ""
    cells = [variant.label + unfinished]
    for measure in measures:
        mean, std = variant.row.stats.get(measure, (math.nan, math.nan))
        spread = "" if math.isnan(std) else f" ± {std:.3f}"
        cells.append(DASH if math.isnan(mean) else f"{mean:.3f}{spread}")
        cells += _change(variant.change.get(measure))
    pairs = str(variant.change[SUCCESS].pairs) if variant.change else DASH
    return [*cells, variant.claim or DASH, variant.agrees or DASH, pairs]


def _change(change: Difference | None) -> list[str]:
    if change is None:
        return [DASH] * 4
    if math.isnan(change.adjusted):
        return [signed(change.mean), DASH, DASH, DASH]
    mean, verdict = (
        (Strong(signed(change.mean)), "yes") if change.beyond_noise else (signed(change.mean), "no")
    )
    return [mean, interval(change), paired.p_value(change), verdict]


def _outcomes(axes: Axes, variants: Sequence[Variant]) -> None:
    """Draw stacked bars of the outcomes, with the interval of the success rate that the table gives."""
    for column, variant in enumerate(variants):
        bottom = 0.0
        for outcome in OUTCOMES:
            share, _ = variant.row.stats.get(outcome, (0.0, math.nan))
            axes.bar(column, share, BAR, bottom, **filled(outcome))
            bottom += share
            if outcome == SUCCESS:
                _rate(axes, column, share, variant.row.interval)
    complete = variants[0].row.stats[SUCCESS][0]
    axes.axhline(complete, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=4)
    axes.set(ylim=(0.0, 1.0), xticks=[])
    axes.set_ylabel("share of episodes", fontsize=8.5, color=INK)
    _style_axes(axes, variants)


def _rate(axes: Axes, column: int, mean: float, interval: tuple[float, float] | None) -> None:
    """Write the rate at the foot of its bar, and draw its interval at the top."""
    axes.annotate(
        f"{mean:.3f}",
        (column, 0.0),
        (0, 5),
        textcoords="offset points",
        ha="center",
        fontsize=8,
        color=INK,
        bbox={"facecolor": "white", "edgecolor": "none", "boxstyle": "round", "pad": 0.15},
        zorder=6,
    )
    if interval is not None:
        axes.plot([column, column], interval, "_-", color=INK, linewidth=0.9, markersize=5, zorder=5)


def _changes(axes: Axes, variants: Sequence[Variant]) -> None:
    """Draw the paired difference in success and its interval; the marker is filled if it exceeds the noise."""
    axes.axhline(0.0, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
    for column, variant in enumerate(variants):
        change = variant.change.get(SUCCESS)
        if change is None:
            continue
        face = INK if change.beyond_noise else "white"
        axes.plot(column, change.mean, "o", color=INK, markerfacecolor=face, markersize=4.5, zorder=4)
        if not math.isnan(change.low):
            error_bar = [[change.mean - change.low], [change.high - change.mean]]
            axes.errorbar(
                column, change.mean, yerr=error_bar, color=INK, elinewidth=0.9, capsize=3.5, capthick=0.9
            )
        _difference(axes, column, change)
    axes.set_xticks(range(len(variants)), [_label(variant) for variant in variants], fontsize=8, color=INK)
    axes.margins(y=0.25)
    axes.set_ylabel("difference\nin success", fontsize=8.5, color=INK)
    _style_axes(axes, variants)


def _difference(axes: Axes, column: int, change: Difference) -> None:
    """Write the difference beyond the end of its interval that is farther from zero."""
    gain = change.mean > 0
    end = change.high if gain else change.low
    axes.annotate(
        signed(change.mean),
        (column, change.mean if math.isnan(end) else end),
        (0, 5 if gain else -5),
        textcoords="offset points",
        ha="center",
        va="bottom" if gain else "top",
        fontsize=7.5,
        color=INK,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )


def _label(variant: Variant) -> str:
    """Return the name in several lines, with features written as in the paper."""
    removed = removed_parts(variant.ablation)
    if removed:
        return "\n".join(["No", *map(symbol, removed)])
    return plot_text("\n".join(textwrap.wrap(variant.label, LETTERS)))


def _style_axes(axes: Axes, variants: Sequence[Variant]) -> None:
    axes.set_xlim(-0.6, len(variants) - 0.4)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    axes.tick_params(axis="x", length=0)
    axes.tick_params(axis="y", labelsize=8, colors=INK)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
