"""A comparison of runs on the terminal, as Markdown, as CSV, and as pictures, world by world.

The picture shows two runs against each other, or a heat map of several.
"""

from __future__ import annotations

import math
import re
import shutil
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from runners.config.escaping import markdown_table, markdown_text, plot_text, visible
from runners.records.atomic_write import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.compare_runs import MEASURES, Change, Compared, RunComparison
from runners.reports.analysis.paired import METRIC, SUCCESS, TIE, interval, p_value, signed
from runners.reports.analysis.summary import DASH, changed_columns
from runners.reports.analysis.tables import aligned, csv_text
from runners.reports.figures.robot_view import halo
from runners.reports.figures.style import FRAME, GREEN, GRID, INK, VERMILION, entitle, new_figure, save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


NAME = "compare"
_SHORT = (SUCCESS, METRIC)  # measures on the terminal if many runs are compared
_MANY = 4  # runs
_MAX_KEYS = 40  # in the table of keys
_HEADER = ("Measure", "Reference", "This", "Difference", "95 %", "p (Holm)")
NOTES = (*paired.NOTES, "Time and path: pairs in which both succeeded.")
TOP = {METRIC: 0.5}  # highest value of a measure, where it is not 1
FORMATS = ("png", "pdf")
PAIR_IN = (9.0, 4.6)
FEWEST_BARS, MOST_BARS = 16, 40  # places for worlds next to the scatter
BAND, CELL_IN, LINE_IN = 75, 0.125, 0.24  # worlds in a band of the heat map, and sizes
MOST_WORLDS = 300  # in a heat map: more cannot be read on a page
LABEL = 34  # most letters in a line of a name


def to_text(comparisons: Sequence[RunComparison]) -> str:
    """Return the tables and notes for a terminal of 80 columns."""
    return "\n\n".join("\n".join(_lines(comparison)) for comparison in comparisons) + "\n"


def to_markdown(comparisons: Sequence[RunComparison], pictures: Sequence[Path] = ()) -> str:
    """Return the tables, notes, pictures and differing keys. pictures: one for each comparison, or none."""
    sections = []
    for number, comparison in enumerate(comparisons):
        name, run_dir = markdown_text(comparison.reference), _code(str(comparison.run.run_dir))
        reference = f"Reference: {name} ({run_dir})"
        sections += [f"**{markdown_text(comparison.place)}**", reference, _table(comparison)]
        sections.append("\n".join(f"- {markdown_text(note)}" for note in comparison.notes))
        sections += [f"![{comparison.measure} by world]({pictures[number].name})"] if pictures else []
        sections += [_keys(comparison)] if comparison.keys else []
    return "\n\n".join([*sections, "  \n".join(NOTES)]) + "\n"


def write(comparisons: Sequence[RunComparison], pictures: Sequence[Path], directory: Path) -> list[Path]:
    """Write `compare.md`, `compare.csv` and `compare_worlds.csv` into `directory`; return their paths."""
    paths = [directory / f"{NAME}.md", directory / f"{NAME}.csv", directory / f"{NAME}_worlds.csv"]
    write_atomically(paths[0], to_markdown(comparisons, pictures))
    write_atomically(
        paths[1], csv_text([line for comparison in comparisons for line in _numbers(comparison)])
    )
    write_atomically(paths[2], csv_text([line for comparison in comparisons for line in _worlds(comparison)]))
    return paths


def _lines(study: RunComparison) -> Iterator[str]:
    yield study.place
    yield f"Differences from: {study.reference}"
    # Of many runs, only the most important measures fit on a terminal.
    is_short = len(study.compared) > _MANY
    measures = [name for name in MEASURES if not is_short or name in _SHORT]
    rows: list[tuple[str, ...]] = [_HEADER]
    for compared in study.compared:
        rows += [
            (f"  {MEASURES[name].header}", *_cells(compared.changes[name], name))
            for name in measures
            if name in compared.changes
        ]
    yield from _under_names(study, aligned(rows, right=range(1, len(_HEADER))), measures)
    if is_short:
        yield f"The other measures are in {NAME}.md."
    yield ""
    width = max(shutil.get_terminal_size().columns, 60)
    for note in (*study.notes, "* beyond the noise: p below 0.05 after Holm's correction."):
        yield from textwrap.wrap(note, width)


def _under_names(study: RunComparison, lines: Sequence[str], measures: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the table, with those of each run below its name."""
    header, *remaining = lines
    yield header
    for compared in study.compared:
        count = sum(name in compared.changes for name in measures)
        header = MEASURES[study.measure].header
        worlds = f"{header} better in {len(compared.better)}, worse in {len(compared.worse)}"
        yield f"{compared.name} ({compared.counts}; {worlds})"
        yield from remaining[:count]
        remaining = remaining[count:]


def _cells(change: Change, measure: str) -> list[str]:
    """Return the cells for means, difference, interval and p."""
    digits = max(MEASURES[measure].digits, 2)
    difference = change.difference
    star = "*" if difference.beyond_noise else ""
    return [
        f"{change.reference:.{digits}f}",
        f"{change.other:.{digits}f}",
        f"{signed(difference.mean)}{star}",
        interval(difference) or DASH,
        p_value(difference) or DASH,
    ]


def _table(study: RunComparison) -> str:
    header = ["Run", *_HEADER, "Pairs", "Worlds better / worse"]
    lines = [header, ["---", "---", *["---:"] * (len(header) - 2)]]
    for compared in study.compared:
        for measure, change in compared.changes.items():
            mean, mean_other, difference, *interval_cells = _cells(change, measure)
            difference = f"**{difference.rstrip('*')}**" if difference.endswith("*") else difference
            by_world = f"{len(compared.better)} / {len(compared.worse)}" if measure == study.measure else ""
            pairs = str(change.difference.pairs)
            lines.append(
                [
                    markdown_text(compared.name),
                    MEASURES[measure].header,
                    mean,
                    mean_other,
                    difference,
                    *interval_cells,
                    pairs,
                    by_world,
                ]
            )
    return markdown_table(lines)


def _keys(study: RunComparison) -> str:
    lines = [["Key", *map(markdown_text, study.names)], ["---"] * (1 + len(study.names))]
    lines += [[_code(key), *map(_key_text, values)] for key, values in list(study.keys.items())[:_MAX_KEYS]]
    omitted = len(study.keys) - _MAX_KEYS
    return (
        "What differs between the configs:\n\n"
        + markdown_table(lines)
        + (f"\n\nAnd {omitted} more keys." if omitted > 0 else "")
    )


def _key_text(value: object) -> str:
    return DASH if value is None else markdown_text(str(value))


def _code(text: str) -> str:
    """Return text as code, in which only the end of the code itself can be markup."""
    return f"`{visible(text).replace('`', chr(39))}`"


def _numbers(study: RunComparison) -> Iterator[dict[str, object]]:
    """Yield the lines of the CSV, not rounded: one for each run and measure."""
    for compared in study.compared:
        for measure, change in compared.changes.items():
            yield {
                **_run_columns(study, compared),
                "measure": measure,
                "reference_mean": change.reference,
                "mean": change.other,
                "difference": change.difference.mean,
                "low": change.difference.low,
                "high": change.difference.high,
                "p": change.difference.p,
                "p_holm": change.difference.adjusted,
                "beyond_noise": change.difference.beyond_noise,
                "worlds": change.difference.worlds,
                "pairs": change.difference.pairs,
            }


def _worlds(study: RunComparison) -> Iterator[dict[str, object]]:
    """Yield the lines of the CSV by world."""
    for compared in study.compared:
        for world, row in compared.worlds.iterrows():
            means = {"measure": study.measure, "reference_mean": row["reference"], "mean": row["other"]}
            yield {**_run_columns(study, compared), "world": world, **means}


def _run_columns(study: RunComparison, compared: Compared) -> dict[str, object]:
    return {
        "place": study.place,
        "reference": study.reference,
        "reference_dir": study.run.run_dir,
        "run": compared.name,
        "run_dir": compared.run.run_dir,
    }


def compare_figures(comparisons: Sequence[RunComparison], directory: Path) -> list[Path]:
    """Draw each comparison, save it in `directory` as PNG and PDF, and return the paths of the PNGs.

    Pictures of an earlier comparison that these do not replace are removed.
    """
    written: list[Path] = []
    for number, study in enumerate(comparisons, start=1):
        figure = _pair(study, study.compared[0]) if len(study.compared) == 1 else _heat_map(study)
        stem = directory / (NAME if len(comparisons) == 1 else f"{NAME}_{number}")
        written += save(figure, stem, FORMATS)
    for path in set(directory.glob(f"{NAME}*.*")) - set(written):
        if re.fullmatch(rf"{NAME}(_\d+)?\.({'|'.join(FORMATS)})", path.name):
            path.unlink()
    return [path for path in written if path.suffix == ".png"]


def _pair(study: RunComparison, compared: Compared) -> Figure:
    figure = new_figure(*PAIR_IN)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
    worlds = compared.worlds
    _draw_scatter(left, worlds, TOP.get(study.measure, 1.0))
    header = MEASURES[study.measure].header
    left.set_xlabel(_wrapped(f"{header}: {study.reference}"), fontsize=8.5, color=INK)
    left.set_ylabel(_wrapped(compared.name), fontsize=8.5, color=INK)
    # Left: one run against the other. Right: the differences, sorted.
    gain = (worlds["other"] - worlds["reference"]).sort_values(kind="stable")
    _draw_bars(right, gain[gain.abs() > TIE])
    right.set_ylabel(f"difference in {header}", fontsize=8.5, color=INK)
    num_equal = len(worlds) - len(compared.better) - len(compared.worse)
    note = (
        f"{compared.name} against {study.reference}, means of the runs in each world: better in {len(compared.better)} "
        f"worlds, worse in {len(compared.worse)}, the same in {num_equal}."
    )
    _entitle(figure, study, note)
    return figure


def _entitle(figure: Figure, study: RunComparison, note: str) -> None:
    """Write what all runs have in common above, and the note and the changed keys that they share below."""
    keys = changed_columns(study.run.frame)
    parts = study.place.split(" · ")
    changes = [part for part in parts if part.partition(" ")[0] in keys]
    changed = [f"Changed: {', '.join(changes)}."] if changes else []
    entitle(figure, " · ".join(part for part in parts if part not in changes), "\n".join([note, *changed]))


def _draw_scatter(axes: Axes, worlds: pd.DataFrame, top: float) -> None:
    """Draw a disc per world, or a larger one with a number for several worlds in one place."""
    rounded = [tuple(np.round(row, 3)) for row in worlds[["reference", "other"]].to_numpy()]
    axes.plot([0, top], [0, top], color=FRAME, linewidth=1.0, zorder=1)
    for (x, y), count in Counter(rounded).items():
        colour = GREEN if y > x else VERMILION if y < x else INK
        axes.scatter(
            x, y, s=22 * (1 + 2.5 * math.log10(count)), color=colour, alpha=0.75, linewidths=0, zorder=3
        )
        if count > 1:
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


def _draw_bars(axes: Axes, gain: pd.Series) -> None:
    """Draw the difference in every world that has one, from worst to best; only the ends if there are too many."""
    # Of too many worlds, draw the worst and the best.
    half = MOST_BARS // 2
    bars = gain if len(gain) <= MOST_BARS else gain.iloc[[*range(half), *range(-half, 0)]]
    colours = [GREEN if value > 0 else VERMILION for value in bars]
    axes.bar(range(len(bars)), bars, color=colours, width=0.8)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    size = 7 if len(bars) <= 25 else 5.5
    axes.set_xticks(range(len(bars)), [str(world) for world in bars.index], rotation=90, fontsize=size)
    left_out = f"; {len(gain) - len(bars)} between them are not shown" if len(bars) < len(gain) else ""
    axes.set_xlabel(
        f"worlds with a difference{left_out}" if len(gain) else "no world has a difference",
        fontsize=8.5,
        color=INK,
    )
    margin = max(0, FEWEST_BARS - len(bars)) / 2  # so that a few bars do not fill the axes
    axes.set_xlim(-0.8 - margin, len(bars) - 0.2 + margin)
    _style_axes(axes, "y")


def _heat_map(study: RunComparison) -> Figure:
    """Draw runs × worlds in bands, with the worlds from the worst to the best of all runs."""
    from matplotlib import colormaps

    means, note = _means(study)
    # Split the worlds into bands, and make room for the longest name.
    bands = [means.iloc[:, start : start + BAND] for start in range(0, means.shape[1], BAND)]
    longest = max(len(line) for name in means.index for line in _wrapped(name).split("\n"))
    width = 1.1 + 0.075 * longest + CELL_IN * max(len(bands[0].columns), 28)
    band_in = 0.55 + LINE_IN * len(means) * (1 + 0.35 * any("\n" in _wrapped(name) for name in means.index))
    figure = new_figure(width, 0.4 + band_in * len(bands))
    colours = colormaps["viridis"].with_extremes(bad="white")
    top = TOP.get(study.measure, 1.0)
    for axes, band in zip(figure.subplots(len(bands), 1, squeeze=False)[:, 0], bands, strict=True):
        # The last band is padded, so that all cells have one size.
        padded = np.full((len(band), len(bands[0].columns)), np.nan)
        padded[:, : band.shape[1]] = band
        picture = axes.pcolormesh(padded, cmap=colours, vmin=0.0, vmax=top, edgecolors="white", linewidth=0.6)
        axes.set_xticks(
            np.arange(band.shape[1]) + 0.5, [str(world) for world in band.columns], rotation=90, fontsize=6
        )
        axes.set_yticks(np.arange(len(band)) + 0.5, [_wrapped(name) for name in band.index], fontsize=7.5)
        axes.invert_yaxis()
        axes.tick_params(length=0, colors=INK)
        axes.spines[:].set_visible(False)
    bar = figure.colorbar(
        picture, ax=figure.axes, shrink=min(1.0, 1.6 / (band_in * len(bands))), pad=0.01, aspect=12
    )
    bar.set_label(MEASURES[study.measure].header, fontsize=7.5, color=INK)
    bar.ax.tick_params(labelsize=7, colors=INK)
    bar.outline.set_visible(False)
    _entitle(figure, study, note)
    return figure


def _means(study: RunComparison) -> tuple[pd.DataFrame, str]:
    """Return the drawn measure by run and world, worst worlds first, and a note on which worlds these are.

    Worlds in which all runs are equal are left out, unless all worlds are such.
    """
    import pandas as pd

    reference_means = paired.values(study.run.frame, study.measure).groupby("world").mean()
    columns = {
        study.reference: reference_means,
        **{compared.name: compared.worlds["other"] for compared in study.compared},
    }
    shared = sorted(set().union(*(compared.worlds.index for compared in study.compared)))
    table = pd.DataFrame(columns).loc[shared]
    # A world where a run is missing counts as different.
    differs = (table.max(axis=1) - table.min(axis=1) > TIE) | table.isna().any(axis=1)
    table = table[differs] if differs.any() else table
    order = table.mean(axis=1).sort_values(kind="stable").index
    return table.loc[order[:MOST_WORLDS]].T, _picture_note(study, len(order), len(shared) - len(order))


def _picture_note(study: RunComparison, differing: int, same: int) -> str:
    """Return a note on what is drawn. differing: number of worlds to draw. same: of worlds with all runs alike."""
    header = MEASURES[study.measure].header
    sentences = [
        f"{header}, mean of the runs in each world, from the world that is worst on average to the best."
    ]
    if differing > MOST_WORLDS:
        sentences.append(f"The {MOST_WORLDS} worst of {differing:,} worlds.")
    if same:
        sentences.append(f"Not drawn: {same:,} worlds in which all are the same.")
    return " ".join([*sentences, "White: not driven."])


def _wrapped(text: str, letters: int = LABEL) -> str:
    return plot_text("\n".join(textwrap.wrap(text, letters)) or text)


def _style_axes(axes: Axes, grid: str) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[:].set_color(FRAME)
    axes.tick_params(labelsize=8, colors=INK, length=0)
    axes.grid(axis="y" if grid == "y" else "both", color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
