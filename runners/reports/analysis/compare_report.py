"""A comparison of runs on the terminal, as Markdown and as CSV."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path

from runners.config.escaping import markdown_table, markdown_text, visible
from runners.records.atomic_write import write_atomically
from runners.reports.analysis import paired
from runners.reports.analysis.compare_runs import MEASURES, Change, Compared, RunComparison
from runners.reports.analysis.paired import METRIC, SUCCESS, interval, p_value, signed
from runners.reports.analysis.summary import DASH
from runners.reports.analysis.tables import aligned, csv_text

NAME = "compare"
_SHORT = (SUCCESS, METRIC)  # measures on the terminal if many runs are compared
_MANY = 4  # runs
_MAX_KEYS = 40  # in the table of keys
_HEADER = ("Measure", "Reference", "This", "Difference", "95 %", "p (Holm)")
NOTES = (*paired.NOTES, "Time and path: pairs in which both succeeded.")


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
