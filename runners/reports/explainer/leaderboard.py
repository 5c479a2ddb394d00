"""The leaderboard as one HTML file: the systems of each setting, sortable, each with the details of its run."""

from __future__ import annotations

import json
import math
import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from runners.config.escaping import html_address, html_text
from runners.config.wording import counted
from runners.reports.analysis.failures import INDEX, folder
from runners.reports.analysis.leaderboard import UNKNOWN, BoardEntry, Setting
from runners.reports.analysis.summary import DASH, INTERVAL_NOTE, METRICS, TIMES, Metric
from runners.reports.explainer.write import document_parts, fill, write_html

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


_SHOWN_FILES = (".md", ".png", ".gif", ".mp4")
_EVERY = "<details><summary>Every setting</summary></details>"  # filled from the data when it is opened


def details(entry: BoardEntry, place: Path) -> str:
    """The details of a run, as HTML. place: the folder of the page, which links start from."""
    return (
        f'<div class="panel"><section><h3>Run</h3>{_facts(_run(entry, place))}</section>'
        f"<section><h3>Figures</h3>{_figures(entry)}</section>"
        f"<section><h3>Changed</h3>{_changes(entry)}</section>"
        f"{_EVERY if entry.config else ''}</div>"
    )


def settings_data(entries: Sequence[BoardEntry]) -> str:
    """The configs of all runs as JSON: {"parts": [{key: value}], "runs": [[number of part]]}; parts are shared."""
    parts: dict[str, int] = {}
    runs = [[parts.setdefault(part, len(parts)) for part in _parts(entry.config)] for entry in entries]
    return f'{{"parts": [{", ".join(parts)}], "runs": {runs}}}'.replace("<", r"\u003c")


def _parts(config: Mapping[str, Any]) -> Iterator[str]:
    """A config as one JSON object per group."""
    groups: dict[str, dict[str, Any]] = {}
    for key, value in config.items():
        groups.setdefault(key.partition(".")[0], {})[key] = value
    return map(json.dumps, groups.values())


def _run(entry: BoardEntry, place: Path) -> Iterator[tuple[str, str]]:
    yield "Directory", _link(entry.run_dir, place, str(entry.run_dir), "/")
    for found in folder(entry.run_dir):
        yield "Reasons", _link(found / INDEX, place, "why the robot went there")
    files = sorted(path for path in entry.run_dir.iterdir() if path.suffix in _SHOWN_FILES)
    if files:
        yield "Files", ", ".join(_link(path, place, path.name) for path in files)
    facts = {
        "Command": f"<code>{escaped(entry.command)}</code>" if entry.command else "",
        "Started": escaped(entry.started[:16].replace("T", " ")),
        "Version": escaped(entry.code),
        "Seed": escaped(entry.seed),
        "Repeats": _repeats(entry),
        "Unfinished": escaped(entry.row.unfinished),
    }
    yield from ((name, text) for name, text in facts.items() if text)


def _repeats(entry: BoardEntry) -> str:
    """What is known of other runs of the same job."""
    if entry.repeats == 1:
        return ""
    agree = "all with the same figures" if entry.same else "with different figures"
    which = "the newest finished" if entry.shown else "an older"
    return f"{which} of {entry.repeats} runs of this job, {agree}"


def _figures(entry: BoardEntry) -> str:
    """All figures, with the standard deviation over runs if there are several, and intervals."""
    spread = (entry.row.runs or 0) > 1
    heads = ["", "mean", *["± over runs"] * spread, "95 %"]
    lines = "".join(
        f'<tr><th scope="row">{escaped(metric.header)}</th>'
        + "".join(f"<td>{text}</td>" for text in _numbers(entry, metric, spread))
        + "</tr>"
        for metric in METRICS
        if metric.key in entry.row.stats
    )
    head = "".join(f'<th scope="col">{head}</th>' for head in heads)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>"


def _numbers(entry: BoardEntry, metric: Metric, spread: bool) -> Iterator[str]:
    mean, deviation = entry.row.stats[metric.key]
    yield rounded(mean, metric.digits)
    if spread:
        yield rounded(deviation, metric.digits)
    bounds = {SUCCESS: entry.row.interval, METRIC: entry.metric_interval}
    yield interval(bounds[metric.key]) if metric.key in bounds else ""


def _changes(entry: BoardEntry) -> str:
    """All that is unusual in the system and in the setting."""
    traits = (*entry.system.traits, *entry.setting.traits)
    items = "".join(f"<li><code>{breakable(one)}</code></li>" for one in traits)
    return f"<ul>{items}</ul>" if traits else "<p>None: each key is as in the file of its option.</p>"


def _facts(facts: Iterator[tuple[str, str]]) -> str:
    return f"<dl>{''.join(f'<dt>{name}</dt><dd>{text}</dd>' for name, text in facts)}</dl>"


def _link(target: Path, place: Path, text: str, end: str = "") -> str:
    address = html_address(os.path.relpath(target, place)) + end
    return f'<a href="{address}">{breakable(text)}</a>'


FILTERS = {"map": "Map set", "robot": "Robot", "sim": "Simulator"}
_SCRIPTS = ("theme.js", "leaderboard.js")
_STYLES = ("index.css", "leaderboard.css")
_NOTES = (
    "Below each map set, robot, simulator and crowd, with all their keys, are the systems that were driven there: a "
    "guide, a planner and a filter with all theirs, and whom they see. Runs that differ in any key are never averaged.",
    f"Interval of success: {INTERVAL_NOTE}",
    "Interval of the BARN metric: bootstrap over worlds; it has no width where all worlds agree.",
    f"Time is the mean over successful episodes. n: episodes; below it, worlds {TIMES} runs.",
    "An unfinished run says how much of it was driven, and comes last.",
)


def write_leaderboard(entries: Sequence[BoardEntry], problems: Sequence[str], path: Path) -> None:
    """Write the page. problems: a line for each run that was left out. Raises InputError if it cannot be written."""
    parts = {
        **document_parts("Leaderboard", _STYLES, _SCRIPTS),
        "COUNT": _count(entries),
        "FILTERS": "\n".join(_filters(entries)),
        "ORDERS": "".join(
            f'<option value="{column.key}" data-first="{column.first}">{column.order}</option>'
            for column in COLUMNS
        ),
        "HEADS": "".join(
            f'<th scope="col" data-key="{column.key}"><button type="button">{column.header}</button></th>'
            for column in COLUMNS
            if column.header
        ),
        "SETTINGS": "\n".join(_settings(entries, path.parent)),
        "DATA": settings_data(entries),
        "NOTES": "".join(f"<li>{escaped(note)}</li>" for note in _NOTES),
        "PROBLEMS": _problems(problems),
    }
    write_html(path, fill("leaderboard.html", parts))


def _count(entries: Sequence[BoardEntry]) -> str:
    systems, settings = {entry.system for entry in entries}, {entry.setting for entry in entries}
    amounts = {"run": len(entries), "system": len(systems), "setting": len(settings)}
    return " · ".join(counted(amount, what) for what, amount in amounts.items())


def _filters(entries: Sequence[BoardEntry]) -> Iterator[str]:
    """A choice for each part in which settings differ, and a box where there are older repeats."""
    for key, word in FILTERS.items():
        values = sorted({getattr(entry.setting, key) for entry in entries})
        options = "".join(f'<option value="{escaped(value)}">{escaped(value)}</option>' for value in values)
        if len(values) > 1:
            yield (
                f'<label>{word} <select data-filter="{key}"><option value="">all</option>{options}'
                "</select></label>"
            )
    older = sum(not entry.shown for entry in entries)
    if older:
        yield f'<label class="box"><input type="checkbox" id="older"> {counted(older, "older repeat")}</label>'


def _settings(entries: Sequence[BoardEntry], place: Path) -> Iterator[str]:
    """A body of the table for each setting, those with most systems first."""
    systems = Counter(setting for setting, _ in {(entry.setting, entry.system) for entry in entries})
    for setting in sorted(systems, key=lambda setting: (-systems[setting], setting)):
        own = {number: entry for number, entry in enumerate(entries) if entry.setting == setting}
        jobs = Counter((entry.system, entry.shown) for entry in own.values())
        rows = "\n".join(
            _rows(number, entry, jobs[entry.system, True] > 1, place) for number, entry in own.items()
        )
        keys = "".join(f' data-{key}="{escaped(getattr(setting, key))}"' for key in FILTERS)
        yield f"<tbody{keys}>\n{_heading(setting)}\n{rows}\n</tbody>"


def _heading(setting: Setting) -> str:
    name = " · ".join(filter(None, (setting.map, setting.subset))) or "no map set"
    sim = f"simulator {UNKNOWN}" if setting.sim == UNKNOWN else f"sim={setting.sim}"
    below = " · ".join(filter(None, (setting.robot, sim)))
    return (
        f'<tr class="setting"><th colspan="{_width()}" scope="rowgroup"><b>{breakable(name)}</b> '
        f"<span>{breakable(below)}</span>{chips(setting.traits)}</th></tr>"
    )


def _rows(number: int, entry: BoardEntry, several: bool, place: Path) -> str:
    """The line of a run, and the line of its details. several: its system has other runs in this setting."""
    values = {"words": _words(entry), **sort_keys(entry)}
    data = "".join(f' data-{key}="{escaped(value)}"' for key, value in values.items())
    return (
        f'<tr class="run{"" if entry.shown else " older"}" id="run-{number}"{data}>'
        f"{''.join(cells(number, entry, several))}</tr>\n"
        f'<tr class="more" id="more-{number}" hidden><td colspan="{_width()}">{details(entry, place)}</td></tr>'
    )


def _words(entry: BoardEntry) -> str:
    """What the search looks at."""
    map_set, subset, robot, sim, traits = entry.setting
    return " ".join([entry.system.name, map_set, subset, robot, sim, *traits, str(entry.run_dir)]).lower()


def _width() -> int:
    return sum(bool(column.header) for column in COLUMNS)


def _problems(problems: Sequence[str]) -> str:
    if not problems:
        return ""
    return f"<h2>Left out</h2>\n<ul>{''.join(f'<li>{escaped(problem)}</li>' for problem in problems)}</ul>"
