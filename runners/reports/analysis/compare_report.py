"""A comparison of runs on the terminal, as Markdown, as LaTeX, and as CSV, world by world."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

from runners.config.escaping import counted, markdown_table, markdown_text, visible
from runners.records.atomic_write import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.compare_runs import MEASURES, Change, Compared, RunComparison
from runners.reports.analysis.paired import COLLISION, METRIC, SUCCESS, interval, p_value, signed
from runners.reports.analysis.study import labels
from runners.reports.analysis.summary import DASH, TIMES
from runners.reports.analysis.tables import aligned, csv_text, driven
from runners.reports.analysis.text_table import Strong, TextTable

NAME = "compare"
_SHORT = (SUCCESS, COLLISION, METRIC)  # measures on the terminal if many runs are compared
_MANY = 4  # runs
_MAX_KEYS = 40  # in the table of keys
_HEADER = ("Measure", "Reference", "This", "Difference", "95 %", "p (Holm)")
_OF_SUCCESSES = "Time and path: pairs in which both succeeded."
NOTES = (*paired.NOTES, _OF_SUCCESSES)


def to_text(comparisons: Sequence[RunComparison]) -> str:
    """Return the tables and notes for a terminal of 80 columns."""
    return "\n\n".join("\n".join(_lines(comparison)) for comparison in comparisons) + "\n"


def to_markdown(comparisons: Sequence[RunComparison], pictures: Sequence[Path] = ()) -> str:
    """Return the tables, notes, pictures and differing keys. pictures: one for each comparison, or none."""
    sections = []
    for number, comparison in enumerate(comparisons):
        name, run_dir = markdown_text(comparison.reference), _code(str(comparison.run.run_dir))
        reference = f"Reference: {name} ({run_dir})"
        sections += [f"**{markdown_text(comparison.place)}**", reference, _table(comparison).to_markdown()]
        sections.append("\n".join(f"- {markdown_text(note)}" for note in comparison.notes))
        sections += [f"![{comparison.measure} by world]({pictures[number].name})"] if pictures else []
        sections += [_keys(comparison)] if comparison.keys else []
    return "\n\n".join([*sections, "  \n".join(NOTES)]) + "\n"


def to_latex(comparisons: Sequence[RunComparison]) -> str:
    """Return the tables as LaTeX floats, each with its notes and a caption."""
    names = labels(NAME, len(comparisons))
    return "\n".join(
        _table(comparison).to_latex(label, _caption(comparison), [*comparison.notes, _OF_SUCCESSES])
        for label, comparison in zip(names, comparisons, strict=True)
    )


def write(comparisons: Sequence[RunComparison], pictures: Sequence[Path], directory: Path) -> list[Path]:
    """Write `compare.md`, `.csv`, `.tex` and `compare_worlds.csv` into `directory`; return their paths."""
    texts = {
        f"{NAME}.md": to_markdown(comparisons, pictures),
        f"{NAME}.csv": csv_text([line for comparison in comparisons for line in _numbers(comparison)]),
        f"{NAME}.tex": to_latex(comparisons),
        f"{NAME}_worlds.csv": csv_text([line for comparison in comparisons for line in _worlds(comparison)]),
    }
    for name, text in texts.items():
        write_atomically(directory / name, text)
    return [directory / name for name in texts]


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


def _caption(study: RunComparison) -> str:
    """Return what was compared, in how many worlds, by which test, and with which seeds and versions."""
    import pandas as pd

    worlds = sorted(len(compared.worlds) for compared in study.compared)
    runs = [study.run, *(compared.run for compared in study.compared)]
    columns = ["run", "seed", "run_dir"]
    frame = pd.concat([run.frame.reindex(columns=columns).drop_duplicates() for run in runs])
    fewer = f"{worlds[0]:,} to " if worlds[0] < worlds[-1] else ""
    return (
        f"Differences from {study.reference}: {study.place} · {fewer}{counted(worlds[-1], 'world')} {TIMES} "
        f"{counted(frame['run'].nunique(), 'run')}, {driven(frame)}. {paired.TEST}"
    )


def _table(study: RunComparison) -> TextTable:
    header = ["Run", *_HEADER, "Pairs", "Worlds better / worse"]
    lines = []
    for compared in study.compared:
        for measure, change in compared.changes.items():
            mean, mean_other, difference, *interval_cells = _cells(change, measure)
            difference = Strong(difference.rstrip("*")) if difference.endswith("*") else difference
            by_world = f"{len(compared.better)} / {len(compared.worse)}" if measure == study.measure else ""
            pairs = str(change.difference.pairs)
            lines.append(
                [
                    compared.name,
                    MEASURES[measure].header,
                    mean,
                    mean_other,
                    difference,
                    *interval_cells,
                    pairs,
                    by_world,
                ]
            )
    return TextTable(header, lines, left=(0, 1))


def _keys(study: RunComparison) -> str:
    lines = [["Key", *map(markdown_text, study.names)], ["---"] * (1 + len(study.names))]
    for key, values in list(study.keys.items())[:_MAX_KEYS]:
        cells = [DASH if value is None else markdown_text(str(value)) for value in values]
        lines.append([_code(key), *cells])
    omitted = len(study.keys) - _MAX_KEYS
    return (
        "What differs between the configs:\n\n"
        + markdown_table(lines)
        + (f"\n\nAnd {omitted} more keys." if omitted > 0 else "")
    )


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
