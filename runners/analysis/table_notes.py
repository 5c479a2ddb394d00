"""What stands above and below a result table: what its rows share, and notes that explain its columns."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from runners.analysis import published
from runners.analysis.summary import (
    DASH,
    INTERVAL_HEADER,
    INTERVAL_NOTE,
    METRICS,
    SMOOTHNESS,
    TIMES,
    Row,
    as_text,
    changed_columns,
    row_keys,
)

if TYPE_CHECKING:
    import pandas as pd


def title(frame: pd.DataFrame) -> str:
    """What all rows have in common (map, subset, robot, changed keys), and the numbers of worlds and runs."""
    shown = [key for key in ("map", "subset", "robot") if key in frame] + changed_columns(frame)
    values = {key: str(frame[key].iloc[0]) for key in shown if frame[key].nunique() == 1}
    common = [f"{key}={value}" if "." in key else value for key, value in values.items() if value]
    return " · ".join([*common, f"{_counted(frame, 'world')} {TIMES} {_counted(frame, 'run')}"])


def notes(rows: Sequence[Row], left_out: Collection[str] = ()) -> list[str]:
    """Notes that explain the table. left_out: headers of columns that it omits."""
    lines = []
    if any(row.runs is not None and row.runs > 1 for row in rows):
        lines.append("± is the standard deviation over runs.")
    if INTERVAL_HEADER not in left_out:
        lines.append(f"{INTERVAL_HEADER}: {INTERVAL_NOTE}")
    means = list(
        dict.fromkeys(
            each.header.split()[0] for each in METRICS if each.of_successes and each.header not in left_out
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
    lines += changed_notes(rows)
    lines += published.notes(rows)
    lines += [f"{label}: {source}." for label, source in _sources(rows).items()]
    if any(row.unfinished for row in rows):
        lines.append("A row that says how much was driven is not finished; its figures are of that part.")
    return lines


def _sources(rows: Sequence[Row]) -> dict[str, str]:
    """Where the published figures are from that are not the paper's, by the row's label."""
    return {row.label: row.source for row in rows if row.source}


def changed_notes(rows: Sequence[Row]) -> list[str]:
    """Notes on keys that differ from the files of their options."""
    ours = [row for row in rows if not row.published_map]
    if len({row.changes for row in ours}) == 1:
        return [f"Changed: {ours[0].changes}."] if ours[0].changes else []
    return list(dict.fromkeys(f"Changed in {row.label}: {row.changes}." for row in ours if row.changes))


def _counted(frame: pd.DataFrame, column: str) -> str:
    """Number of worlds, or runs, per row of the table; the minimum and the maximum if rows differ."""
    keys = ["system", *row_keys(frame)]
    counts = frame.assign(**{key: as_text(frame[key]) for key in keys}).groupby(keys)[column].nunique()
    fewest, most = int(counts.min()), int(counts.max())
    number = str(most) if fewest == most else f"{fewest}{DASH}{most}"
    return f"{number} {column}" + "s" * (most != 1)
