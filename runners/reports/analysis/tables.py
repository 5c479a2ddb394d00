"""Result tables as Markdown, CSV, LaTeX and HTML and on the terminal, and the notes and sections below them."""

from __future__ import annotations

import csv
import io
import math
import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TextIO

from lme.metrics import interval_over_worlds
from runners.config.escaping import csv_value, html_text, markdown_text, visible
from runners.config.schema import PUBLISHED_MARK
from runners.records.atomic_write import write_atomically
from runners.records.launch_record import read_launch
from runners.reports.analysis import published
from runners.reports.analysis.failures import failed_section, timeouts_section
from runners.reports.analysis.summary import (
    DASH,
    GROUP_KEYS,
    INTERVAL_HEADER,
    INTERVAL_NOTE,
    METRICS,
    SMOOTHNESS,
    TIMES,
    Metric,
    Row,
    as_text,
    changed_columns,
    numbers,
    row_keys,
)
from runners.reports.analysis.text_table import TextTable

if TYPE_CHECKING:
    import pandas as pd
    import rich.table

_INTERVALS = "Intervals of success are Wilson's, over worlds."  # in a caption
GAP = 2  # between columns on the terminal
Column = tuple[str, ...]  # its header, then a cell for each row
FAMILY = "world_family"  # column of map sets that draw a family of worlds for every episode


class TableSetting(NamedTuple):
    """What all rows have in common. place: map, subset and robot; changes: changed keys; size: worlds and runs."""

    place: tuple[str, ...]
    changes: tuple[str, ...]
    size: str

    def __str__(self) -> str:
        return " · ".join([*self.place, *self.changes, self.size])

    @property
    def short(self) -> str:
        """The setting without changed keys, for the title of a picture."""
        return " · ".join([*self.place, self.size])


def title(frame: pd.DataFrame) -> str:
    """Return what all rows have in common (map, subset, robot, changed keys), and the numbers of worlds and runs."""
    return str(shared_setting(frame))


def shared_setting(frame: pd.DataFrame) -> TableSetting:
    """Return what all rows have in common."""

    def shared(keys: Iterable[str]) -> dict[str, str]:
        common = [key for key in keys if frame[key].notna().all() and frame[key].nunique() == 1]
        return {key: value for key in common if (value := str(frame[key].iloc[0]))}

    return TableSetting(
        tuple(shared(key for key in ("map", "subset", "robot") if key in frame).values()),
        tuple(f"{key}={value}" for key, value in shared(changed_columns(frame)).items()),
        f" {TIMES} ".join(_count_texts(frame, ["world", "run"])),
    )


def picture_titles(settings: Sequence[TableSetting], headings: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the title of each study in a picture, and the lines of the caption that name changed keys.

    headings: what begins each title. Changed keys that all share are in the caption, others in the titles.
    """
    changes = {setting.changes for setting in settings}
    texts = [setting.short if len(changes) == 1 else str(setting) for setting in settings]
    titles = [" · ".join(filter(None, words)) for words in zip(headings, texts, strict=True)]
    shared = changes.pop() if len(changes) == 1 else ()
    return titles, [f"Changed: {', '.join(shared)}."] if shared else []


def notes(rows: Sequence[Row], left_out: Collection[str] = ()) -> list[str]:
    """Return the notes that explain the table. left_out: headers of columns that it omits."""
    lines = []
    if any(row.runs is not None and row.runs > 1 for row in rows):
        lines.append("± is the standard deviation over runs.")
    if INTERVAL_HEADER not in left_out:
        lines.append(f"{INTERVAL_HEADER}: {INTERVAL_NOTE}")
    # Name the columns that are means over successes, as far as they are shown.
    means = list(
        dict.fromkeys(
            column.header.split()[0]
            for column in METRICS
            if column.of_successes and column.header not in left_out
        )
    )
    if means:
        words = " and ".join(means).capitalize() + (" are means" if len(means) > 1 else " is the mean")
        lines.append(f"{words} over successful episodes.")
    smoothness = next(metric.header for metric in METRICS if metric.key == SMOOTHNESS)
    if smoothness not in left_out and any(SMOOTHNESS in row.stats for row in rows):
        lines.append(
            "|Δω|: mean change of the turn rate from one control step to the next; lower is smoother."
        )
    # Where rows differ from the shipped options, and where published figures come from.
    lines += changed_notes(rows)
    lines += published.notes(rows)
    sources = {row.label: row.source for row in rows if row.source}  # of figures that are not from the paper
    lines += [f"{label}: {source}." for label, source in sources.items()]
    if any(row.unfinished for row in rows):
        lines.append("A row that says how much was driven is not finished; its figures are of that part.")
    return lines


def changed_notes(rows: Sequence[Row]) -> list[str]:
    """Return the notes on keys that differ from the files of their options."""
    own_rows = [row for row in rows if not row.published_map]
    if len({row.changes for row in own_rows}) == 1:
        return [f"Changed: {own_rows[0].changes}."] if own_rows[0].changes else []
    return list(dict.fromkeys(f"Changed in {row.label}: {row.changes}." for row in own_rows if row.changes))


def _count_texts(frame: pd.DataFrame, columns: list[str]) -> Iterator[str]:
    """Yield the numbers of worlds and runs per row of the table; the minimum and the maximum if rows differ."""
    keys = ["system", *row_keys(frame)]
    texts = frame[[*keys, *columns]].assign(**{key: as_text(frame[key]) for key in keys})
    counts = texts.groupby(keys)[columns].nunique()
    for column in columns:
        fewest, largest = int(counts[column].min()), int(counts[column].max())
        number = str(largest) if fewest == largest else f"{fewest}{DASH}{largest}"
        yield f"{number} {column}" + "s" * (largest != 1)


def driven(frame: pd.DataFrame) -> str:
    """Return the seeds of these records, and the versions of lme that drove them, for a caption."""
    seeds = sorted({int(seed) for seed in frame["seed"].dropna()}) if "seed" in frame else []
    run_dirs = dict.fromkeys(frame["run_dir"].dropna()) if "run_dir" in frame else {}
    launches = [read_launch(Path(str(run_dir))) for run_dir in run_dirs]
    versions = dict.fromkeys(launch.code for launch in launches if launch is not None and launch.code)
    words = f"seed{'s' * (len(seeds) > 1)} {', '.join(map(str, seeds))}" if seeds else "seed not recorded"
    return "; ".join([words, *(versions or ["version not recorded"])])


def to_markdown(rows: Sequence[Row]) -> str:
    """Return the table in GitHub's Markdown, with notes below."""
    header, *lines = _cells(rows, " ± ")
    table = TextTable(header, lines, left=range(1 + len(rows[0].keys))).to_markdown()
    return f"{table}\n\n" + "\n".join(f"{markdown_text(note)}  " for note in notes(rows)) + "\n"


def to_csv(rows: Sequence[Row]) -> str:
    """Return the numbers of the table, not rounded; missing ones are empty. Changed keys have a column if any."""
    has_changes = any(row.changes for row in rows)
    return csv_text(
        [
            {
                "label": row.name,
                **row.keys,
                **({"changes": row.changes} if has_changes else {}),
                "global_planner": row.global_planner,
                "episodes": row.episodes,
                "worlds": row.worlds,
                "runs": row.runs,
                **numbers(row),
            }
            for row in rows
        ]
    )


def to_html(rows: Sequence[Row]) -> str:
    """Return the table and its notes as HTML elements."""
    header, *lines = ([html_text(cell) for cell in line] for line in _cells(rows, " ± "))
    head = "".join(f"<th>{cell}</th>" for cell in header)
    body = "\n".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in line) + "</tr>" for line in lines)
    footer = "<br>\n".join(map(html_text, notes(rows)))
    return f"<table>\n<tr>{head}</tr>\n{body}\n</table>\n<p>{footer}</p>"


def to_latex(frame: pd.DataFrame, rows: Sequence[Row]) -> str:
    """Return the table for `frame` as a LaTeX float, with its notes and a caption."""
    header, *lines = _cells(rows, " ± ")
    table = TextTable(header, lines, left=range(1 + len(rows[0].keys)))
    return table.to_latex(
        "tab:results", f"Results: {title(frame)}, {driven(frame)}. {_INTERVALS}", notes(rows)
    )


def to_rich(rows: Sequence[Row], heading: str, width: int) -> rich.table.Table:
    """Return the table for a terminal of `width` columns, at least 80; what does not fit is wrapped or omitted.

    Omitted columns are named.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    columns, gap, left_out = _fit(rows, width)
    footer = notes(rows, [header for header, *_ in left_out]) + _describe_omitted(left_out, width)
    caption = Text("\n".join(map(visible, footer)))
    table = Table(title=Text(visible(heading)), caption=caption, caption_justify="left")
    table.box, table.show_edge, table.pad_edge, table.padding = SIMPLE_HEAD, False, False, (0, gap - 1, 0, 0)
    # Text, not str: Rich would read a unit in brackets as markup.
    for number, (header, *_) in enumerate(columns):
        is_label = number <= len(rows[0].keys)
        table.add_column(Text(header), justify="left" if is_label else "right", overflow="fold")
    for row, line in zip(rows, list(zip(*columns, strict=True))[1:], strict=True):
        table.add_row(*map(Text, line), style="dim" if row.published_map else None)
    return table


def print_table(frame: pd.DataFrame, rows: Sequence[Row]) -> None:
    """Print the rows of the table for `frame` on the terminal."""
    from rich.console import Console

    console = Console()
    console.print(to_rich(rows, title(frame), console.width))


def write_tables(frame: pd.DataFrame, rows: Sequence[Row], run_dir: Path) -> list[Path]:
    """Write the rows of the table for `frame` into `run_dir` as Markdown, CSV and LaTeX; return the paths.

    `table.md` also says how long episodes timed out, and links to explainer pages of failed ones, if there are any.
    """
    sections = families_section(frame) + timeouts_section(frame) + failed_section(frame, run_dir)
    texts = {
        "table.md": f"**{markdown_text(title(frame))}**\n\n{to_markdown(rows)}{sections}",
        "table.csv": to_csv(rows),
        "table.tex": to_latex(frame, rows),
    }
    for name, text in texts.items():
        write_atomically(run_dir / name, text)
    return [run_dir / name for name in texts]


def _cells(rows: Sequence[Row], plus_minus: str, to: str = DASH) -> list[list[str]]:
    """Return header and lines as text; the interval is next to the success rate."""
    metrics = [metric for metric in METRICS if any(metric.key in row.stats for row in rows)]
    headers = [metric.header for metric in metrics]
    keys = [key.capitalize() if key in GROUP_KEYS else visible(key) for key in rows[0].keys]
    lines = [["System", *keys, headers[0], INTERVAL_HEADER, *headers[1:], "n"]]
    for row in rows:
        success, *further_values = [_stat(row, metric, plus_minus) for metric in metrics]
        interval = DASH if row.interval is None else f"{row.interval[0]:.3f}{to}{row.interval[1]:.3f}"
        episodes = DASH if row.episodes is None else str(row.episodes)
        values = [visible(value) or DASH for value in row.keys.values()]
        lines.append([visible(row.name), *values, success, interval, *further_values, episodes])
    # A column on global planners, if there are several systems, or if one used such a planner.
    names = {row.label.removesuffix(PUBLISHED_MARK) for row in rows}
    if len(names) > 1 or any(row.global_planner != "no" for row in rows):
        for line, cell in zip(lines, ["Global planner", *(row.global_planner for row in rows)], strict=True):
            line.append(cell)
    return lines


def _fit(rows: Sequence[Row], width: int) -> tuple[list[Column], int, list[Column]]:
    """Return columns that fit into `width` characters, the gap between them, and the columns that were omitted.

    First, ± moves below its mean; then as few columns as possible are omitted.
    """
    columns = list(zip(*_cells(rows, " ±"), strict=True))
    if _width(columns, GAP) <= width:
        return columns, GAP, []
    # Fold every column to its longest word, and omit one more column until the rest fits.
    columns = list(zip(*_cells(rows, " ±", f" {DASH}"), strict=True))
    omittable = _least_needed_first(columns[1:], len(rows[0].keys))
    for count in range(len(omittable) + 1):
        folded = [_wrap(column) for column in columns if column not in omittable[:count]]
        for gap in (GAP, 1):
            if _width(folded, gap) <= width:
                return folded, gap, omittable[:count]
    return folded, gap, omittable


def _least_needed_first(columns: Sequence[Column], keys: int) -> list[Column]:
    """Return the columns that a table can omit, those that are needed least first.

    These are columns with one value, then spare metrics, then others, each from the right, and the collision rate at
    last. keys: number of columns at the left that distinguish the rows; they stay if they vary, like the success rate.
    """
    metrics = {metric.header: metric for metric in METRICS}
    ranked = []
    # Rank by need, the least needed first; equal ranks go from right to left.
    for position, column in enumerate(columns):
        metric = metrics.get(column[0])
        if _is_constant(column) and column[0] != INTERVAL_HEADER:
            rank = 0 if metric is None else 1
        elif metric is None:
            rank = 4
        elif metric.key == "collision":
            rank = 5
        else:
            rank = 2 if metric.spare else 3
        if column[0] != METRICS[0].header and (position >= keys or rank == 0):
            ranked.append((rank, -position, column))
    return [column for *_, column in sorted(ranked)]


def _is_constant(column: Column) -> bool:
    """Return whether several rows have a value, all of them the same one."""
    values = [cell for cell in column[1:] if cell != DASH]
    return len(values) > 1 and len(set(values)) == 1


def _describe_omitted(left_out: Sequence[Column], width: int) -> list[str]:
    """Return lines that name the omitted columns and say where to find them."""
    constant = [
        f"{header} {next(cell for cell in cells if cell != DASH)}"
        for header, *cells in left_out
        if _is_constant((header, *cells))
    ]
    lines = [f"The same in every row with a value: {', '.join(constant)}."] if constant else []
    left_out_headers = [column[0] for column in left_out if not _is_constant(column)]
    if left_out_headers:
        lines.append(
            f"Left out at {width} columns: {', '.join(left_out_headers)}. "
            "A wider terminal shows them, and so does `lme table RUN --format md`."
        )
    return lines


def _width(columns: Sequence[Sequence[str]], gap: int) -> int:
    """Return the width of the table on the terminal, in characters."""
    widest = (max(len(line) for cell in column for line in cell.split("\n")) for column in columns)
    return sum(width + gap for width in widest) - gap


def _wrap(column: Column) -> Column:
    """Return the cells, wrapped to the width of their longest word."""
    longest_word = max(len(word) for cell in column for word in cell.split())
    return tuple("\n".join(textwrap.wrap(cell, longest_word, break_on_hyphens=False)) for cell in column)


def _stat(row: Row, metric: Metric, plus_minus: str) -> str:
    mean, std = row.stats.get(metric.key, (math.nan, math.nan))
    if math.isnan(mean):
        return DASH
    spread = metric.spread and not math.isnan(std)
    return f"{mean:.{metric.digits}f}" + (f"{plus_minus}{std:.{metric.digits}f}" if spread else "")


def families_section(frame: pd.DataFrame) -> str:
    """Return the section of table.md; empty if the records have no families. frame: records of one or more runs."""
    if FAMILY not in frame:
        return ""
    from lme.worlds.cold_trial import STAND_IN

    episodes = frame[frame[FAMILY].notna()]
    # A row for each combination of values and family.
    keys = ["system", *row_keys(frame), FAMILY]
    texts = episodes.assign(**{key: as_text(episodes[key]) for key in keys})
    rows = [[*map(str, values), *_figures(group)] for values, group in texts.groupby(keys, sort=False)]
    names = [key.capitalize() if key.isidentifier() else key for key in keys[:-1]]
    header = [*names, "Family", "Success", "95 % CI", "Collision", "Timeout", "n"]
    stands_in = (episodes[FAMILY] == STAND_IN).any()
    note = (
        f"\n{STAND_IN} are generated: no maps of real buildings were given (map.paths).\n"
        if stands_in
        else ""
    )
    table = TextTable(header, rows, left=range(len(keys))).to_markdown()
    return f"\n## Families of worlds\n\n{table}\n{note}"


def _figures(group: pd.DataFrame) -> list[str]:
    low, high = interval_over_worlds(group["outcome"] == "success", group["world"])
    success, collision, timeout = (
        f"{(group['outcome'] == outcome).mean():.3f}" for outcome in ("success", "collision", "timeout")
    )
    return [success, f"{low:.3f}–{high:.3f}", collision, timeout, str(len(group))]


def aligned(rows: Sequence[Sequence[str]], right: Collection[int]) -> list[str]:
    """Return one line per row, with cells padded to the width of their column. right: the right-aligned columns."""
    rows = [[visible(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if number in right else cell.ljust(width)
            for number, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def csv_text(lines: Sequence[Mapping[str, object]]) -> str:
    """Return a CSV with every column that any line has, in order of first appearance."""
    text = io.StringIO()
    write_csv(text, dict.fromkeys(name for line in lines for name in line), lines)
    return text.getvalue()


def write_csv(file: TextIO, names: Collection[str], lines: Iterable[Mapping[str, object]]) -> None:
    """Write a CSV line by line. names: of the columns; a line may lack some."""
    writer = csv.DictWriter(file, names, lineterminator="\n")
    writer.writerow({name: csv_value(name) for name in names})
    writer.writerows({name: csv_value(value) for name, value in line.items()} for line in lines)
