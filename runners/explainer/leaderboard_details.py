"""What the leaderboard shows of a run when its line is opened: figures, changed keys, files, and every setting."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from runners.analysis.failures import INDEX, folder
from runners.analysis.leaderboard import BoardEntry
from runners.analysis.summary import METRICS, Metric
from runners.config.escaping import html_address
from runners.explainer.leaderboard_cells import METRIC, SUCCESS, breakable, escaped, interval, rounded

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
