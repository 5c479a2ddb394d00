"""The line of a run on the leaderboard: its cells, and what it is sorted by."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from runners.analysis.leaderboard import BoardEntry
from runners.analysis.summary import DASH, TIMES
from runners.config.escaping import html_text
from runners.config.wording import counted

SUCCESS, METRIC = "success", "barn_metric"  # the figures with an interval
_MOST_CHIPS = 2  # of what is unusual, that a line shows
_BAR_PX = 96  # length of the bar of an interval; the whole of it is a rate of one
_UP, _DOWN = "ascending", "descending"


class _Column(NamedTuple):
    """key: of what is sorted by. order: its name among the orders. header: empty for an order without a column.

    first: the direction that is chosen first, the best on top. digits: of a figure.
    """

    key: str
    order: str
    header: str
    first: str
    digits: int = 0


COLUMNS = (
    _Column("system", "system", "System", _UP),
    _Column(SUCCESS, "success", "Success", _DOWN, 3),
    _Column("collision", "collision", "Collision", _UP, 3),
    _Column("timeout", "timeout", "Timeout", _UP, 3),
    _Column(METRIC, "BARN metric", "BARN metric", _DOWN, 3),
    _Column("time_s", "time", "Time [s]", _UP, 1),
    _Column("n", "n", "n", _DOWN),
    _Column("started", "newest", "", _DOWN),
)
_FIGURES = {column.key: column for column in COLUMNS if column.digits}


def sort_keys(entry: BoardEntry) -> dict[str, str]:
    """What a line is sorted by, by column: numbers or text. A figure of an unfinished run is empty: it comes last."""
    means = {key: "" if entry.row.unfinished else plain(mean(entry, key)) for key in _FIGURES}
    means[SUCCESS] = f"{means[SUCCESS]} {means[METRIC]}".strip()  # the metric decides between equals
    others = {
        "system": entry.system.name.lower(),
        "n": str(entry.row.episodes or 0),
        "started": entry.started,
    }
    return {**others, **means}


def cells(number: int, entry: BoardEntry, several: bool) -> Iterator[str]:
    """The cells of a line. several: the system has other runs in this setting, so the line says which it is."""
    job = [f"seed {entry.seed}, {counted(entry.runs, 'run')}"] * several
    flags = "".join(f'<span class="flag">{escaped(flag)}</span>' for flag in _flags(entry))
    yield (
        f'<th scope="row"><button type="button" aria-expanded="false" aria-controls="more-{number}">'
        f"{breakable(entry.system.label)}</button>{chips((*job, *entry.system.traits))}{flags}</th>"
    )
    intervals = {SUCCESS: entry.row.interval, METRIC: entry.metric_interval}
    for key, column in _FIGURES.items():
        value, bounds = mean(entry, key), intervals.get(key)
        below = f"<small>{interval(bounds)}</small>" if key in intervals else ""
        bar = _bar(value, bounds) if key == SUCCESS and bounds else ""
        yield _cell(column.header, f"{bar}<b>{rounded(value, column.digits)}</b>{below}", key)
    counts = f"{entry.row.worlds} {TIMES} {entry.row.runs}"
    yield _cell("n", f"<b>{entry.row.episodes}</b><small>{counts}</small>", "n")


def chips(traits: Sequence[str]) -> str:
    """What is unusual, in short; how many more there are if there are many."""
    shown = [f"<code>{escaped(one)}</code>" for one in traits[:_MOST_CHIPS]]
    more = [f"<i>+{len(traits) - _MOST_CHIPS}</i>"] * (len(traits) > _MOST_CHIPS)
    return f'<span class="chips">{"".join(shown + more)}</span>' if traits else ""


def mean(entry: BoardEntry, key: str) -> float:
    """The mean of a figure; NaN if the run does not have it."""
    return entry.row.stats.get(key, (math.nan,))[0]


def rounded(value: float, digits: int) -> str:
    return DASH if math.isnan(value) else f"{value:.{digits}f}"


def interval(bounds: tuple[float, float] | None) -> str:
    low, high = bounds or (math.nan, math.nan)
    return DASH if math.isnan(low) else f"{low:.3f}{DASH}{high:.3f}"


def plain(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6f}"


def breakable(text: str) -> str:
    """Text as HTML that may break between the words of a key or a path, and not within them."""
    return "<wbr>".join(map(html_text, re.split(r"(?<=[._/=:,])(?=\w)", text)))


def escaped(text: str) -> str:
    return html_text(text)


def _cell(header: str, text: str, kind: str) -> str:
    return f'<td class="{kind}" data-label="{header}">{text}</td>'


def _flags(entry: BoardEntry) -> Iterator[str]:
    """What a reader must know of a run before its figures."""
    if entry.row.unfinished:
        yield entry.row.unfinished
    if not entry.shown:
        yield "older repeat"
    if not entry.same:
        yield "repeats differ"


def _bar(value: float, bounds: tuple[float, float]) -> str:
    """The interval of a rate, from 0 to 1, and the rate itself."""
    low, high, at = (round(_BAR_PX * part, 1) for part in (*bounds, value))
    return (
        f'<svg width="{_BAR_PX}" height="10" aria-hidden="true"><rect class="rail" y="4" width="{_BAR_PX}" '
        f'height="2"/><rect class="range" x="{low}" y="3" width="{high - low:.1f}" height="4" rx="2"/>'
        f'<circle cx="{at}" cy="5" r="4"/></svg>'
    )
