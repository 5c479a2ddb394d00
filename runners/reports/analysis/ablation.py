"""The ablation study: what each part of the method contributes, and whether that agrees with the paper.

The paper describes its figure in words, without numbers (§IV, Ablation Studies). Its statements are data here. The
rules in `NOTES` decide from our paired differences whether we agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

from runners.config.escaping import markdown_text, plot_text
from runners.config.systems import SEVERAL
from runners.reports.analysis import paired
from runners.reports.analysis.paired import METRIC, SUCCESS, Block, Difference, interval, signed
from runners.reports.analysis.study import SweepStudy
from runners.reports.analysis.summary import DASH, INTERVAL_HEADER, INTERVAL_NOTE, Row
from runners.reports.analysis.tables import driven, title
from runners.reports.analysis.text_table import Strong, TextTable
from runners.reports.figures.style import GRID, INK, OUTCOMES, filled, new_figure, outcome_keys, symbol

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN, COMPLETE = "ablation", "none"
SOURCE = "the LME paper, §IV, Ablation Studies (words without numbers)"
# the paper's statements are about either reading of its method
SYSTEMS = ("LME", "LME (as run)", "LME as printed")
ABOUT = {"map": "barn", "robot": "jackal", "scale": ""}  # and its benchmark


class Claim(NamedTuple):
    """The paper's statement about removing a part. tier: from 3, the largest loss, to 0, no loss.

    tier is None for a loss of unknown size. ASSUMED: "noticeable" (2) is more than "moderate" (1), because the paper
    lists them in this order.
    """

    tier: int | None
    words: str


CLAIMS = {  # in the order of the paper's figure
    "no_a_close": Claim(1, "moderate degradation"),
    "no_a_dev": Claim(0, "almost no effect"),
    "no_c_o": Claim(3, "the most significant, a substantial decrease"),
    "no_c_t": Claim(2, "noticeable degradation"),
    "no_a_mount": Claim(2, "noticeable degradation"),
    "no_c_h": Claim(1, "moderate degradation"),
    "no_maintenance": Claim(None, "an important role, a lower success rate"),
}
MOST = 3
ALMOST = 0.02  # of success rate: "almost no effect". ASSUMED: two deviations of the published rate over runs (.009)
_BEYOND, _STATEMENT = "Beyond the noise", ("The paper says", "Agrees")  # columns
_ANSWERS = {"yes": "Agrees", "in part": "Agrees in part", "no": "Does not agree", "open": "Open"}
FEWEST = 20  # worlds needed for a verdict if no difference is beyond the noise
MARGIN = 0.1  # of success rate: an interval that reaches farther may contain the loss that the paper states
NOTES = (
    f"The paper's statements: {SOURCE}. Ours is a 2D simulator, not Gazebo, and the paper does not list its hundred "
    "worlds.",
    "Agrees, if the paper states a loss: yes for a loss beyond the noise; in part if another variant, with a larger "
    "stated loss, loses less, and the two intervals do not overlap; no otherwise. "
    'The order of the stated losses is "most significant", "noticeable", "moderate".',
    f'Agrees, if the paper states "almost no effect": yes unless a change beyond the noise exceeds {ALMOST:g}.',
    f"Open: nothing is beyond the noise, and there are fewer than {FEWEST} worlds or an interval reaches farther "
    f"than {MARGIN:g}.",
)

WIDTH_IN, STUDY_IN, AROUND_IN = 7.2, 4.0, 0.75
VARIANT_IN = 0.8  # least width of a variant; many variants widen the figure
STUDIES = 4  # at most: more cannot be read on a page
BAR = 0.72
GAP = 0.08  # between panels, in panels
CAPTION = (
    f"Whiskers above: {INTERVAL_HEADER}. {INTERVAL_NOTE}\n"
    "Below: difference in success to the complete method, paired by world and run,\n"
    "95 % bootstrap over worlds; filled where beyond the noise (Holm-adjusted sign-flip p < 0.05)."
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


@dataclass(frozen=True, slots=True)
class AblationStudy(SweepStudy):
    """Variants of one system in one setting, the complete one first. heading: the system. driven: seeds, versions."""

    name: ClassVar[str] = "ablation"
    legend: ClassVar[str] = CAPTION
    heading: str
    setting: str
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
        claims = CLAIMS if _is_the_papers(block) else {}
        # Variants in the order of the paper, then all others by name.
        names = [
            *(name for name in CLAIMS if name in block.variants),
            *sorted(block.variants.keys() - CLAIMS.keys()),
        ]
        variants = [Variant(COMPLETE, paired.row(block.baseline), {})]
        # Judge each variant about which the paper makes a statement.
        for name in names:
            change = {measure: changes[name] for measure, changes in by_measure.items() if name in changes}
            verdict = _verdict(name, by_measure[SUCCESS], claims) if name in claims else None
            claim = claims[name].words if verdict else ""
            variants.append(Variant(name, paired.row(block.variants[name]), change, claim, *(verdict or ())))
        frame = pd.concat([block.baseline, *block.variants.values()])
        return cls(block.heading, title(block.baseline), tuple(variants), driven(frame))

    @property
    def judged(self) -> list[Variant]:
        """Variants about which the paper makes a statement."""
        return [variant for variant in self.variants if variant.agrees]

    def sentences(self) -> list[str]:
        """Return a line for each of the paper's statements: whether our results agree with it."""
        lines = [f"{variant_label(variant.ablation)}: {variant.words}" for variant in self.judged]
        return [f"{self.heading}, {self.setting}: the paper's ablation and ours.", *lines] if lines else []

    def tables(self) -> list[str]:
        """Return the table, and a list of verdicts if there are any."""
        lines = (
            f"- {markdown_text(variant_label(variant.ablation))}: {variant.words}" for variant in self.judged
        )
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
                "place": self.setting,
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
    def figure(cls, studies: Sequence[Self], noted: bool = True) -> Figure:
        """Draw outcomes and paired differences of every variant."""
        drawn_studies = studies[:STUDIES]
        width = max(WIDTH_IN, VARIANT_IN * (1 + max(len(study.variants) for study in drawn_studies)))
        figure = new_figure(width, AROUND_IN + STUDY_IN * len(drawn_studies))
        panels = figure.subplots(
            2 * len(drawn_studies),
            1,
            squeeze=False,
            height_ratios=[1.6, 1.0] * len(drawn_studies),
            gridspec_kw={"hspace": GAP},
        )[:, 0]
        # Two panels for each study: the outcomes above, the differences below.
        for number, study in enumerate(drawn_studies):
            upper_axes, lower_axes = panels[2 * number : 2 * number + 2]
            _outcomes(upper_axes, study.variants)
            _changes(lower_axes, study.variants)
            upper_axes.set_title(
                plot_text(f"{study.heading} · {study.setting}"), fontsize=9, color=INK, loc="left"
            )
        figure.legend(
            handles=outcome_keys(),
            loc="outside upper right",
            ncols=3,
            frameon=False,
            fontsize=8,
            labelcolor=INK,
        )
        omitted = f" {len(studies) - STUDIES} more in {cls.name}.md." if len(studies) > STUDIES else ""
        if noted:
            figure.supxlabel(CAPTION + omitted, fontsize=7, color=INK, x=0.01, ha="left")
        return figure


def variant_label(ablation: str) -> str:
    """Return a label such as "No a_close" for no_a_close, and "No c_o, c_t" for two parts at once."""
    if ablation == COMPLETE:
        return "Complete"
    return f"No {', '.join(removed.removeprefix('no_') for removed in ablation.split(SEVERAL))}"


def _is_the_papers(block: Block) -> bool:
    """Return whether the paper's statements apply: its method on its benchmark, with some successes."""
    baseline = block.baseline.iloc[0]
    matches = all(str(baseline.get(key, value)) == value for key, value in ABOUT.items())
    return (
        matches and str(baseline["system"]) in SYSTEMS and bool((block.baseline["outcome"] == SUCCESS).any())
    )


def _verdict(
    name: str, differences: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str] | None:
    """Return whether the change agrees with the claim, and a sentence with the reason; None without a comparison."""
    change = differences.get(name)
    if change is None:
        return None
    agrees, reason = _judge(name, change, differences, claims)
    interval_text = interval(change)
    result = f"{signed(change.mean)} ({interval_text})" if interval_text else signed(change.mean)
    return agrees, f"the paper says {claims[name].words}; ours {result}. {_ANSWERS[agrees]}: {reason}."


def _judge(
    name: str, change: Difference, differences: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str]:
    tier = claims[name].tier
    if _is_open(change, tier):
        return "open", "too noisy to tell"
    # The paper states no effect: only a change beyond the noise and beyond ALMOST contradicts it.
    if tier == 0:
        if not change.beyond_noise:
            return "yes", "no change beyond the noise"
        if abs(change.mean) <= ALMOST:
            return "yes", f"a change beyond the noise, but not beyond {ALMOST:g}"
        return "no", f"a {'gain' if change.mean > 0 else 'loss'} beyond the noise"
    if not change.beyond_noise:
        return "no", "no loss beyond the noise"
    if change.mean > 0:
        return "no", "on the contrary, a gain beyond the noise"
    if tier is None:
        return "yes", "a loss beyond the noise"
    if tier == MOST:
        return _judge_largest_loss(name, change, differences, claims)
    larger_losses = list(_exceeded_variants(name, change, differences, claims))
    if larger_losses:
        return "in part", f"a loss beyond the noise, but larger than that of {' and '.join(larger_losses)}"
    return "yes", "a loss beyond the noise"


def _is_open(change: Difference, tier: int | None) -> bool:
    """Return whether there are too few worlds, or too wide an interval, to show a difference."""
    largest_loss = max(-change.low, change.high) if tier == 0 else -change.low
    return not change.beyond_noise and (change.worlds < FEWEST or largest_loss > MARGIN)


def _judge_largest_loss(
    name: str, change: Difference, differences: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> tuple[str, str]:
    rivals = {rival: differences[rival] for rival in claims if rival in differences and rival != name}
    larger = [variant_label(rival) for rival, difference in rivals.items() if difference.high < change.low]
    if larger:
        return "in part", f"a loss beyond the noise, but smaller than that of {' and '.join(larger)}"
    largest = all(difference.mean > change.mean for difference in rivals.values())
    return "yes", "the largest loss of all" if largest else "a loss beyond the noise"


def _exceeded_variants(
    name: str, change: Difference, differences: Mapping[str, Difference], claims: Mapping[str, Claim]
) -> Iterator[str]:
    """Yield the variants with a larger loss in the paper that lose less here, with disjoint intervals."""
    tier = claims[name].tier or 0
    for rival, claim in claims.items():
        if (
            claim.tier is not None
            and claim.tier > tier
            and rival in differences
            and change.high < differences[rival].low
        ):
            yield variant_label(rival)


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
    cells = [variant_label(variant.ablation) + unfinished]
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
    axes.set_xticks(
        range(len(variants)), [_label(variant.ablation) for variant in variants], fontsize=8, color=INK
    )
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


def _label(ablation: str) -> str:
    """Return the name in several lines, with features written as in the paper."""
    if ablation == COMPLETE:
        return "Complete"
    removals = [removed.removeprefix("no_") for removed in ablation.split(SEVERAL)]
    return "\n".join(["No", *(symbol(removed) for removed in removals)])


def _style_axes(axes: Axes, variants: Sequence[Variant]) -> None:
    axes.set_xlim(-0.6, len(variants) - 0.4)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    axes.tick_params(axis="x", length=0)
    axes.tick_params(axis="y", labelsize=8, colors=INK)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
