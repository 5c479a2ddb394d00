"""A chart of ablations: outcomes of each variant, and whether it differs from the complete method."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config.ablations import SEVERAL
from runners.config.escaping import plot_text
from runners.reports.analysis.ablation import COMPLETE, NAME, AblationStudy, Variant
from runners.reports.analysis.paired import SUCCESS, Difference, signed
from runners.reports.analysis.summary import INTERVAL_HEADER, INTERVAL_NOTE
from runners.reports.figures.style import GRID, INK, STYLES, new_figure, save, symbol
from runners.reports.plots.comparison import HATCHES, OUTCOMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_IN, STUDY_IN, AROUND_IN = 7.2, 4.0, 0.75
VARIANT_IN = 0.8  # least width of a variant; many variants widen the figure
STUDIES = 4  # at most: more cannot be read on a page
BAR = 0.72
GAP = 0.08  # between panels, in panels
NOTES = (
    f"Whiskers above: {INTERVAL_HEADER}. {INTERVAL_NOTE}\n"
    "Below: difference in success to the complete method, paired by world and run,\n"
    "95 % bootstrap over worlds; filled where beyond the noise (Holm-adjusted sign-flip p < 0.05)."
)


def ablation_figure(studies: Sequence[AblationStudy], place: Path) -> list[Path]:
    """Draw outcomes and paired differences of every variant, save them in `place` as PNG and PDF, return the paths."""
    shown = studies[:STUDIES]
    width = max(WIDTH_IN, VARIANT_IN * (1 + max(len(study.variants) for study in shown)))
    figure = new_figure(width, AROUND_IN + STUDY_IN * len(shown))
    panels = figure.subplots(
        2 * len(shown), 1, squeeze=False, height_ratios=[1.6, 1.0] * len(shown), gridspec_kw={"hspace": GAP}
    )[:, 0]
    for number, study in enumerate(shown):
        above, below = panels[2 * number : 2 * number + 2]
        _outcomes(above, study.variants)
        _changes(below, study.variants)
        above.set_title(plot_text(f"{study.heading} · {study.place}"), fontsize=9, color=INK, loc="left")
    figure.legend(
        handles=_keys(), loc="outside upper right", ncols=3, frameon=False, fontsize=8, labelcolor=INK
    )
    more = f" {len(studies) - STUDIES} more in {NAME}.md." if len(studies) > STUDIES else ""
    figure.supxlabel(NOTES + more, fontsize=7, color=INK, x=0.01, ha="left")
    return save(figure, place / NAME, ("png", "pdf"))


def _outcomes(axes: Axes, variants: Sequence[Variant]) -> None:
    """Draw stacked bars of the outcomes, with the interval of the success rate that the table gives."""
    for column, variant in enumerate(variants):
        bottom = 0.0
        for outcome in OUTCOMES:
            share, _ = variant.row.stats.get(outcome, (0.0, math.nan))
            axes.bar(column, share, BAR, bottom, hatch=HATCHES.get(outcome), **_filled(outcome))
            bottom += share
            if outcome == SUCCESS:
                _rate(axes, column, share, variant.row.interval)
    complete = variants[0].row.stats[SUCCESS][0]
    axes.axhline(complete, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=4)
    axes.set(ylim=(0.0, 1.0), xticks=[])
    axes.set_ylabel("share of episodes", fontsize=8.5, color=INK)
    _plain(axes, variants)


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
            reach = [[change.mean - change.low], [change.high - change.mean]]
            axes.errorbar(
                column, change.mean, yerr=reach, color=INK, elinewidth=0.9, capsize=3.5, capthick=0.9
            )
        _difference(axes, column, change)
    axes.set_xticks(range(len(variants)), [_label(each.ablation) for each in variants], fontsize=8, color=INK)
    axes.margins(y=0.25)
    axes.set_ylabel("difference\nin success", fontsize=8.5, color=INK)
    _plain(axes, variants)


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
    """The name in lines, with features as in the paper."""
    if ablation == COMPLETE:
        return "Complete"
    parts = [part.removeprefix("no_") for part in ablation.split(SEVERAL)]
    return "\n".join(["No", *(symbol(part) for part in parts)])


def _keys() -> list[Any]:
    from matplotlib.patches import Patch

    return [Patch(label=kind, hatch=HATCHES.get(kind), **_filled(kind)) for kind in OUTCOMES]


def _filled(kind: str) -> dict[str, Any]:
    return {"facecolor": STYLES[kind].colour, "edgecolor": "white", "linewidth": 0.4}


def _plain(axes: Axes, variants: Sequence[Variant]) -> None:
    axes.set_xlim(-0.6, len(variants) - 0.4)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    axes.tick_params(axis="x", length=0)
    axes.tick_params(axis="y", labelsize=8, colors=INK)
    axes.grid(axis="y", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
