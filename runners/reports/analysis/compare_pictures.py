"""Pictures of compared runs, world by world: two runs against each other, or a heat map of several."""

from __future__ import annotations

import math
import re
import textwrap
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from runners.config.escaping import counted, plot_text
from runners.reports.analysis import paired
from runners.reports.analysis.compare_report import NAME
from runners.reports.analysis.compare_runs import MEASURES, Compared, RunComparison
from runners.reports.analysis.paired import METRIC, TIE
from runners.reports.analysis.study import worst_and_best
from runners.reports.analysis.summary import changed_columns
from runners.reports.figures.robot_view import halo
from runners.reports.figures.style import FRAME, GREEN, GRID, INK, VERMILION, entitle, new_figure, save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TOP = {METRIC: 0.5}  # highest value of a measure, where it is not 1
FORMATS = ("png", "pdf")
PAIR_IN, FLAT = (9.0, 4.6), 0.46  # and its height as a share of a page's width
WIDE, HIGH = 0.25, 0.05  # of a number of worlds in the scatter, as shares of its side
FEWEST_BARS, MOST_BARS = 16, 40  # places for worlds next to the scatter
BAND, CELL_IN, LINE_IN = 75, 0.125, 0.24  # worlds in a band of the heat map, and sizes
MOST_WORLDS = 300  # in a heat map: more cannot be read on a page
MOST_RUNS = 60  # in a heat map, the reference included
LABEL = 34  # most letters in a line of a name


class PrintSpace(NamedTuple):
    """Width of a figure in a paper, and its height at most."""

    width_in: float
    height_in: float


class Noted(NamedTuple):
    """A figure, and what its reader must know."""

    figure: Figure
    note: str


def compare_figures(comparisons: Sequence[RunComparison], directory: Path) -> list[Path]:
    """Draw each comparison, save it in `directory` as PNG and PDF, and return the paths of the PNGs.

    Pictures of an earlier comparison that these do not replace are removed.
    """
    written: list[Path] = []
    for number, study in enumerate(comparisons, start=1):
        stem = directory / (NAME if len(comparisons) == 1 else f"{NAME}_{number}")
        written += save(compare_figure(study).figure, stem, FORMATS)
    for path in set(directory.glob(f"{NAME}*.*")) - set(written):
        if re.fullmatch(rf"{NAME}(_\d+)?\.({'|'.join(FORMATS)})", path.name):
            path.unlink()
    return [path for path in written if path.suffix == ".png"]


def compare_figure(study: RunComparison, page: PrintSpace | None = None) -> Noted:
    """Draw a comparison. page: what it must fit, without heading and note; None for a picture that has both."""
    drawn = _pair(study, study.compared[0], page) if len(study.compared) == 1 else _heat_map(study, page)
    if page is None:
        # What all runs have in common is above; the note, and the changed keys that they share, are below.
        keys = changed_columns(study.run.frame)
        parts = study.place.split(" · ")
        changes = [part for part in parts if part.partition(" ")[0] in keys]
        title = " · ".join(part for part in parts if part not in changes)
        changed = [f"Changed: {', '.join(changes)}."] if changes else []
        entitle(drawn.figure, title, "\n".join([drawn.note, *changed]))
    return drawn


def _pair(study: RunComparison, compared: Compared, page: PrintSpace | None) -> Noted:
    size_in = PAIR_IN if page is None else (page.width_in, page.width_in * FLAT)
    figure = new_figure(*size_in)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
    worlds = compared.worlds
    _draw_scatter(left, worlds, TOP.get(study.measure, 1.0))
    header = MEASURES[study.measure].header
    left.set_xlabel(_wrapped(f"{header}: {study.reference}"), fontsize=8.5, color=INK)
    left.set_ylabel(_wrapped(compared.name), fontsize=8.5, color=INK)
    # Left: one run against the other. Right: the differences, sorted.
    gain = (worlds["other"] - worlds["reference"]).sort_values(kind="stable")
    _draw_bars(right, gain[gain.abs() > TIE], int(MOST_BARS * size_in[0] / PAIR_IN[0]))
    right.set_ylabel(f"difference in {header}", fontsize=8.5, color=INK)
    num_equal = len(worlds) - len(compared.better) - len(compared.worse)
    note = (
        f"{compared.name} against {study.reference}, means of the runs in each world: better in {len(compared.better)} "
        f"worlds, worse in {len(compared.worse)}, the same in {num_equal}."
    )
    return Noted(figure, note)


def _draw_scatter(axes: Axes, worlds: pd.DataFrame, top: float) -> None:
    """Draw a disc per world, or a larger one for several worlds in one place, with their number where it has room."""
    rounded = [tuple(np.round(row, 3)) for row in worlds[["reference", "other"]].to_numpy()]
    axes.plot([0, top], [0, top], color=FRAME, linewidth=1.0, zorder=1)
    labelled: list[tuple[float, float]] = []
    for (x, y), count in Counter(rounded).most_common():
        colour = GREEN if y > x else VERMILION if y < x else INK
        axes.scatter(
            x, y, s=22 * (1 + 2.5 * math.log10(count)), color=colour, alpha=0.75, linewidths=0, zorder=3
        )
        has_room = all(abs(x - a) > WIDE * top or abs(y - b) > HIGH * top for a, b in labelled)
        if count > 1 and has_room:
            labelled.append((x, y))
            axes.annotate(f"{count} worlds", (x, y), fontsize=7, color=INK, zorder=4, **_inwards(x, y, top))
    pad = 0.06 * top
    axes.set(xlim=(-pad, top + pad), ylim=(-pad, top + pad), aspect="equal")
    _style_axes(axes, "both")


def _inwards(x: float, y: float, top: float) -> dict[str, Any]:
    """Return the position of a label beside its point: towards the middle of the axes, so that it stays inside."""
    is_left_half, is_lower_half = 2 * x < top, 2 * y < top
    return {
        "xytext": (5 if is_left_half else -5, 8 if is_lower_half else -8),
        "textcoords": "offset points",
        "ha": "left" if is_left_half else "right",
        "va": "bottom" if is_lower_half else "top",
        "path_effects": halo(),
    }


def _draw_bars(axes: Axes, gain: pd.Series, most: int) -> None:
    """Draw the difference in every world that has one, from worst to best; of more than `most` only the ends."""
    # Of too many worlds, draw the worst and the best.
    half = most // 2
    bars = gain if len(gain) <= most else gain.iloc[[*range(half), *range(-half, 0)]]
    colours = [GREEN if value > 0 else VERMILION for value in bars]
    axes.bar(range(len(bars)), bars, color=colours, width=0.8)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    size = 7 if len(bars) <= 25 else 5.5
    axes.set_xticks(range(len(bars)), [str(world) for world in bars.index], rotation=90, fontsize=size)
    left_out = f";\n{len(gain) - len(bars)} between them are not shown" if len(bars) < len(gain) else ""
    axes.set_xlabel(
        f"worlds with a difference{left_out}" if len(gain) else "no world has a difference",
        fontsize=8.5,
        color=INK,
    )
    margin = max(0, FEWEST_BARS - len(bars)) / 2  # so that a few bars do not fill the axes
    axes.set_xlim(-0.8 - margin, len(bars) - 0.2 + margin)
    _style_axes(axes, "y")


def _heat_map(study: RunComparison, page: PrintSpace | None) -> Noted:
    """Draw runs × worlds in bands, with the worlds from the worst to the best of all runs that are drawn."""
    from matplotlib import colormaps

    # Make room for the longest name, and split the worlds into bands.
    runs = worst_and_best(study.compared, _mean_gain, MOST_RUNS - 1)
    names = [_wrapped(name) for name in (study.reference, *(run.name for run in runs))]
    around_in = 1.1 + 0.075 * max(len(line) for name in names for line in name.split("\n"))
    band_in = 0.55 + LINE_IN * len(names) * (1 + 0.35 * any("\n" in name for name in names))
    band, most = BAND, MOST_WORLDS
    if page is not None:
        band = int((page.width_in - around_in) / CELL_IN)
        most = band * max(int(page.height_in / band_in), 1)
    means, note = _means(study, runs, most)
    bands = [means.iloc[:, start : start + band] for start in range(0, means.shape[1], band)]
    width = around_in + CELL_IN * max(len(bands[0].columns), 28) if page is None else page.width_in
    figure = new_figure(width, (0.4 if page is None else 0.1) + band_in * len(bands))
    colours = colormaps["viridis"].with_extremes(bad="white")
    top = TOP.get(study.measure, 1.0)
    for axes, part in zip(figure.subplots(len(bands), 1, squeeze=False)[:, 0], bands, strict=True):
        # The last band is padded, so that all cells have one size.
        padded = np.full((len(part), len(bands[0].columns)), np.nan)
        padded[:, : part.shape[1]] = part
        picture = axes.pcolormesh(padded, cmap=colours, vmin=0.0, vmax=top, edgecolors="white", linewidth=0.6)
        axes.set_xticks(
            np.arange(part.shape[1]) + 0.5, [str(world) for world in part.columns], rotation=90, fontsize=6
        )
        axes.set_yticks(np.arange(len(part)) + 0.5, names, fontsize=7.5)
        axes.invert_yaxis()
        axes.tick_params(length=0, colors=INK)
        axes.spines[:].set_visible(False)
    bar = figure.colorbar(
        picture, ax=figure.axes, shrink=min(1.0, 1.6 / (band_in * len(bands))), pad=0.01, aspect=12
    )
    bar.set_label(MEASURES[study.measure].header, fontsize=7.5, color=INK)
    bar.ax.tick_params(labelsize=7, colors=INK)
    bar.outline.set_visible(False)
    return Noted(figure, note)


def _mean_gain(run: Compared) -> float:
    """Return by how much a run is better than the reference; -inf if that is not known."""
    mean = float((run.worlds["other"] - run.worlds["reference"]).mean())
    return -math.inf if math.isnan(mean) else mean


def _means(study: RunComparison, runs: Sequence[Compared], most: int) -> tuple[pd.DataFrame, str]:
    """Return the drawn measure by run and world, worst worlds first, and a note on what is drawn.

    Worlds in which all runs are equal are left out, unless all worlds are such. most: largest number of worlds.
    """
    import pandas as pd

    reference_means = paired.values(study.run.frame, study.measure).groupby("world").mean()
    columns = {
        study.reference: reference_means,
        **{run.name: run.worlds["other"] for run in runs},
    }
    shared = sorted(set().union(*(run.worlds.index for run in runs)))
    table = pd.DataFrame(columns).loc[shared]
    # A world where a run is missing counts as different.
    differs = (table.max(axis=1) - table.min(axis=1) > TIE) | table.isna().any(axis=1)
    table = table[differs] if differs.any() else table
    order = table.mean(axis=1).sort_values(kind="stable").index
    note = _picture_note(study, len(runs), len(order), len(shared) - len(order), most)
    return table.loc[order[:most]].T, note


def _picture_note(study: RunComparison, runs: int, differing: int, same: int, most: int) -> str:
    """Return a note on what is drawn.

    runs: number of runs beside the reference. differing: number of worlds to draw. same: of worlds with all runs alike.
    """
    header = MEASURES[study.measure].header
    sentences = [
        f"{header}, mean of the runs in each world, from the world that is worst on average to the best."
    ]
    if runs < len(study.compared):
        sentences.append(
            f"The {runs // 2} worst and {runs - runs // 2} best of {len(study.compared):,} runs."
        )
    if differing > most:
        sentences.append(f"The {most} worst of {differing:,} worlds.")
    if same:
        sentences.append(f"Not drawn: {counted(same, 'world')} in which all are the same.")
    return " ".join([*sentences, "White: not driven."])


def _wrapped(text: str) -> str:
    return plot_text("\n".join(textwrap.wrap(text, LABEL)) or text)


def _style_axes(axes: Axes, grid: Literal["both", "y"]) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[:].set_color(FRAME)
    axes.tick_params(labelsize=8, colors=INK, length=0)
    axes.grid(axis=grid, color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
