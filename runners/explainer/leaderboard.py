"""The leaderboard as one HTML file: systems × settings, and every run, sortable and with links to explainer pages."""

from __future__ import annotations

import html
import math
import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from runners.analysis.failures import INDEX, folder
from runners.analysis.leaderboard import Entry, Setting
from runners.analysis.summary import DASH, INTERVAL_NOTE, METRICS, Metric
from runners.explainer.write import asset, fill, policy, write_html

FILTERS = {"map": "Map set", "robot": "Robot", "sim": "Simulator"}
_SCRIPTS = ("theme.js", "leaderboard.js")
_STYLES = ("index.css", "leaderboard.css")
_SUCCESS, _METRIC = "success", "barn_metric"
_NOTES = (
    f"95 % of success: {INTERVAL_NOTE}",
    "95 % of the BARN metric: bootstrap over worlds; it has no width where all worlds agree.",
    "Time and path are means over successful episodes. n: episodes.",
    "A column of the first table is one map set, robot and simulator with all their keys; a line is one guide and "
    "planner with all theirs. Runs that differ in any key are never averaged.",
    "An unfinished run says how much of it was driven, and is sorted last.",
)


def write_leaderboard(entries: Sequence[Entry], problems: Sequence[str], path: Path) -> None:
    """Write the page. problems: a line for each run that was left out. Raises InputError if it cannot be written."""
    style = "\n".join(map(asset, _STYLES))
    script = '(() => {{\n"use strict";\n{}\n}})();'.format("\n".join(map(asset, _SCRIPTS)))
    parts = {
        "POLICY": policy(style, script),
        "STYLE": style,
        "SCRIPT": script,
        "COUNT": html.escape(_count(entries)),
        "FILTERS": "\n".join(_filter(key, word, entries) for key, word in FILTERS.items()),
        "BOARD": _board([entry for entry in entries if entry.shown], entries),
        "RUNS": _runs(entries, path.parent),
        "NOTES": "<br>\n".join(map(html.escape, _NOTES)),
        "PROBLEMS": _problems(problems),
    }
    write_html(path, fill("leaderboard.html", parts))


def _count(entries: Sequence[Entry]) -> str:
    systems, settings = ({getattr(entry, part) for entry in entries} for part in ("system", "setting"))
    older = sum(not entry.shown for entry in entries)
    parts = [_of(len(entries), "run"), _of(len(systems), "system"), _of(len(settings), "setting")]
    return " · ".join([*parts, *[f"{older} repeated"] * bool(older)])


def _of(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"


def _filter(key: str, word: str, entries: Sequence[Entry]) -> str:
    values = sorted({getattr(entry.setting, key) for entry in entries})
    options = "".join(f'<option value="{_text(value)}">{_text(value)}</option>' for value in values)
    return (
        f'<label>{word} <select data-filter="{key}"><option value="">all</option>{options}</select></label>'
    )


def _board(shown: Sequence[Entry], entries: Sequence[Entry]) -> str:
    """Systems × settings, those with most runs first: success and the BARN metric, each with its interval."""
    driven = Counter(entry.setting for entry in shown)
    settings = sorted(driven, key=lambda setting: (-driven[setting], setting))
    heads = "".join(_head(setting.name, _keys(setting)) for setting in settings)
    lines = []
    for system in sorted({entry.system for entry in shown}, key=str.casefold):
        cells = [
            _cell(
                [entry for entry in shown if (entry.system, entry.setting) == (system, setting)],
                setting,
                entries,
            )
            for setting in settings
        ]
        lines.append(
            f'<tr data-system="{_text(system)}"><th scope="row">{_text(system)}</th>{"".join(cells)}</tr>'
        )
    return _table("Systems and settings", _head("System") + heads, lines)


def _cell(found: Sequence[Entry], setting: Setting, entries: Sequence[Entry]) -> str:
    """The runs of one system in one setting. Those of several seeds or numbers of runs stand below each other."""
    ordered = sorted(found, key=lambda entry: (bool(entry.row.unfinished), entry.seed, -entry.runs))
    blocks = [_figures(entry, len(ordered) > 1, entries.index(entry)) for entry in ordered]
    value = _order(ordered[0]) if ordered else ""
    return f'<td data-value="{value}"{_keys(setting)}>{"".join(blocks) or DASH}</td>'


def _order(entry: Entry) -> str:
    """What a cell is sorted by: success, then the BARN metric. An unfinished run comes last."""
    means = [entry.row.stats.get(key, (math.nan,))[0] for key in (_SUCCESS, _METRIC)]
    return "" if entry.row.unfinished else " ".join(f"{mean:.6f}" for mean in means if not math.isnan(mean))


def _figures(entry: Entry, several: bool, number: int) -> str:
    success, metric = (entry.row.stats.get(key, (math.nan,))[0] for key in (_SUCCESS, _METRIC))
    told = [f"seed {entry.seed}, {_of(entry.runs, 'run')}"] * several + [entry.row.unfinished]
    below = "".join(f"<small>{_text(word)}</small>" for word in told if word)
    return (
        f'<a class="figures" href="#run-{number}"><b>{_number(success, 3)}</b>'
        f"<small>{_range(entry.row.interval)}</small>"
        f"<small>BARN {_number(metric, 3)} ({_range(entry.metric_interval)})</small>{below}</a>"
    )


def _runs(entries: Sequence[Entry], place: Path) -> str:
    heads = ["Seed"]
    metrics = [metric for metric in METRICS if any(metric.key in entry.row.stats for entry in entries)]
    for metric in metrics:
        heads += [metric.header, *["95 %"] * (metric.key in (_SUCCESS, _METRIC))]
    lines = [_run(entry, number, metrics, place) for number, entry in enumerate(entries)]
    first, last = map(_left_head, ("Map set, robot, simulator", "Run"))
    numbers = "".join(map(_head, [*heads, "n", "Started"]))
    return _table("Every run", _head("System") + first + numbers + last, lines)


def _run(entry: Entry, number: int, metrics: Sequence[Metric], place: Path) -> str:
    told = filter(None, (entry.row.unfinished, _repeats(entry)))
    cells = [
        f'<th scope="row">{_text(entry.system)}{"".join(f"<small>{_text(word)}</small>" for word in told)}</th>',
        f'<td class="text">{_text(entry.setting.name)}</td>',
        f"<td>{_text(entry.seed)}</td>",
    ]
    intervals = {_SUCCESS: entry.row.interval, _METRIC: entry.metric_interval}
    for metric in metrics:
        mean = entry.row.stats.get(metric.key, (math.nan,))[0]
        cells.append(_value(mean, metric.digits))
        if metric.key in intervals:
            bounds = intervals[metric.key] or (math.nan, math.nan)
            cells.append(f'<td data-value="{_plain(bounds[0])}">{_range(bounds)}</td>')
    cells += [
        _value(entry.row.episodes or 0, 0),
        f"<td>{_text(_date(entry.started))}</td>",
        _where(entry, place),
    ]
    older = "" if entry.shown else ' class="older"'
    return (
        f'<tr id="run-{number}" data-system="{_text(entry.system)}"{_keys(entry.setting)}{older}>'
        f"{''.join(cells)}</tr>"
    )


def _repeats(entry: Entry) -> str:
    """What the page says of other runs of the same job."""
    if entry.repeats == 1:
        return ""
    agree = "all with the same figures" if entry.same else "with different figures"
    return f"{'shown' if entry.shown else 'older'} of {entry.repeats} runs of this job, {agree}"


def _where(entry: Entry, place: Path) -> str:
    """The run's directory, a link to its explainer pages, and how it was driven."""
    pages = [
        f'<a href="{quote(os.path.relpath(found / INDEX, place))}">why the robot went there</a>'
        for found in folder(entry.run_dir)
    ]
    told = "<br>".join(_text(word) for word in (entry.command, entry.code) if word)
    more = [f"<details><summary>how</summary><code>{told}</code></details>"] if told else []
    return f'<td class="text"><span>{_text(str(entry.run_dir))}</span>{"".join([*pages, *more])}</td>'


def _table(name: str, heads: str, lines: Sequence[str]) -> str:
    body = "\n".join(lines)
    return (
        f'<div class="wide" tabindex="0" role="region" aria-label="{name}">\n'
        f"<table><thead><tr>{heads}</tr></thead>\n<tbody>\n{body}\n</tbody></table></div>"
    )


def _head(name: str, keys: str = "") -> str:
    return f'<th scope="col"{keys}><button type="button">{_text(name)}</button></th>'


def _left_head(name: str) -> str:
    return _head(name, ' class="text"')


def _keys(setting: Setting) -> str:
    """What the filters look at."""
    return "".join(f' data-{key}="{_text(getattr(setting, key))}"' for key in FILTERS)


def _value(value: float, digits: int) -> str:
    return f'<td data-value="{_plain(value)}">{_number(value, digits)}</td>'


def _plain(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6f}"


def _number(value: float, digits: int) -> str:
    return DASH if math.isnan(value) else f"{value:.{digits}f}"


def _range(bounds: tuple[float, float] | None) -> str:
    low, high = bounds or (math.nan, math.nan)
    return DASH if math.isnan(low) else f"{low:.3f}{DASH}{high:.3f}"


def _date(started: str) -> str:
    """Date and time to the minute."""
    return started[:16].replace("T", " ")


def _problems(problems: Sequence[str]) -> str:
    if not problems:
        return ""
    items = "".join(f"<li>{_text(problem)}</li>" for problem in problems)
    return f"<h2>Left out</h2>\n<ul>{items}</ul>"


def _text(text: str) -> str:
    return html.escape(text)
