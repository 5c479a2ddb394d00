"""The leaderboard as one HTML file: the systems of each setting, sortable, each with the details of its run."""

from __future__ import annotations

import math
import os
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from runners.config.escaping import counted, html_address, visible
from runners.reports.analysis.failures import INDEX, folder
from runners.reports.analysis.leaderboard import BoardEntry
from runners.reports.analysis.summary import DASH, INTERVAL_NOTE, TIMES
from runners.reports.explainer.write import asset, document_parts, write_html

SUCCESS, METRIC = "success", "barn_metric"  # the figures with an interval
_SHOWN_FILES = (".md", ".png", ".gif", ".mp4")
_NOTES = (
    "Below each map set, robot, simulator and crowd, with all their keys, are the systems that were driven there: a "
    "guide, a planner and a filter with all theirs, and whom they see. Runs that differ in any key are never averaged.",
    f"Interval of success: {INTERVAL_NOTE}",
    "Interval of the BARN metric: bootstrap over worlds; it has no width where all worlds agree.",
    f"Time is the mean over successful episodes. n: episodes; below it, worlds {TIMES} runs.",
    "An unfinished run says how much of it was driven, and comes last. Of several runs of one job the newest finished "
    "one is shown; it links to the others.",
)


class _Column(NamedTuple):
    """A column. first: the direction of the first sort, with the best on top. digits: of a figure."""

    header: str
    key: str
    first: str = "descending"
    digits: int = 0


COLUMNS = (
    _Column("System", "system", "ascending"),
    _Column("Success", SUCCESS, digits=3),
    _Column("Collision", "collision", "ascending", 3),
    _Column("Timeout", "timeout", "ascending", 3),
    _Column("BARN metric", METRIC, digits=3),
    _Column("Time [s]", "time_s", "ascending", 1),
    _Column("n", "n"),
    _Column("Started", "started"),
)


class _Cell(NamedTuple):
    """A cell. value: what it is sorted by; empty comes last. below: small text under `text`."""

    value: str
    text: str
    below: str


def write_leaderboard(entries: Sequence[BoardEntry], problems: Sequence[str], path: Path) -> None:
    """Write the page. problems: a line for each run that was left out. Raises InputError if it cannot be written."""
    from jinja2 import Environment, StrictUndefined

    document = document_parts("Leaderboard", ("index.css", "leaderboard.css"), ("leaderboard.js",))
    # Names and paths may come from somebody else's run: whatever the template shows is made visible, then escaped.
    environment = Environment(
        autoescape=True,
        finalize=lambda value: visible(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.from_string(asset("leaderboard.html")).render(
        head=document["HEAD"],
        script=document["SCRIPT"],
        count=_count(entries),
        columns=COLUMNS,
        settings=list(_settings(entries, path.parent)),
        notes=_NOTES,
        problems=problems,
    )
    write_html(path, page)


def _count(entries: Sequence[BoardEntry]) -> str:
    systems, settings = {entry.system for entry in entries}, {entry.setting for entry in entries}
    amounts = {"run": len(entries), "system": len(systems), "setting": len(settings)}
    return " · ".join(counted(amount, noun) for noun, amount in amounts.items())


def _settings(entries: Sequence[BoardEntry], page_dir: Path) -> Iterator[tuple[Any, list[dict[str, Any]]]]:
    """Yield each setting and its lines, by decreasing number of systems; the best success is the first line."""
    systems = Counter(setting for setting, _ in {(entry.setting, entry.system) for entry in entries})
    entries_by_setting, runs = defaultdict(list), defaultdict(list)
    for entry in entries:
        runs[entry.job].append(entry)
        if entry.shown:
            entries_by_setting[entry.setting].append(entry)
    # One line for each job that is to be shown.
    for setting in sorted(systems, key=lambda setting: (-systems[setting], setting)):
        jobs = Counter(entry.system for entry in entries_by_setting[setting])
        lines = [
            _line(entry, jobs[entry.system] > 1, runs[entry.job], page_dir)
            for entry in sorted(entries_by_setting[setting], key=_worst_last)
        ]
        yield setting, lines


def _worst_last(entry: BoardEntry) -> tuple[bool, float, float]:
    means = (entry.row.stats.get(key, (math.nan,))[0] for key in (SUCCESS, METRIC))
    success, metric = (-mean if mean == mean else math.inf for mean in means)
    return bool(entry.row.unfinished), success, metric


def _line(
    entry: BoardEntry, has_several_jobs: bool, runs: Sequence[BoardEntry], page_dir: Path
) -> dict[str, Any]:
    """Return the parts of a line. has_several_jobs: whether its system has others in the setting. runs: of its job."""
    job = (f"seed {entry.seed}, {counted(entry.runs, 'run')}",) if has_several_jobs else ()
    return {
        "label": entry.system.label,
        "name": entry.system.name,
        "traits": (*job, *entry.system.traits),
        "flags": [*filter(None, [entry.row.unfinished]), *["repeats differ"] * (not entry.same)],
        "cells": list(_cells(entry)),
        "facts": list(_facts(entry, [run for run in runs if run is not entry], page_dir)),
    }


def _cells(entry: BoardEntry) -> Iterator[_Cell]:
    """Yield the cells of a line except its name. Figures of an unfinished run have no value to sort by."""
    row, intervals = entry.row, {SUCCESS: entry.row.interval, METRIC: entry.metric_interval}
    # Figures of the row, with intervals where they are known.
    for column in COLUMNS:
        if not column.digits:
            continue
        mean = row.stats.get(column.key, (math.nan,))[0]
        low, high = intervals.get(column.key) or (math.nan, math.nan)
        has_value = not math.isnan(mean)
        yield _Cell(
            f"{mean:.6f}" if has_value and not row.unfinished else "",
            f"{mean:.{column.digits}f}" if has_value else DASH,
            "" if math.isnan(low) else f"{low:.3f}{DASH}{high:.3f}",
        )
    yield _Cell(str(row.episodes), str(row.episodes), f"{row.worlds} {TIMES} {row.runs}")
    day, _, time = entry.started[:16].partition("T")
    yield _Cell(entry.started, day, time)


def _facts(
    entry: BoardEntry, repeats: Sequence[BoardEntry], page_dir: Path
) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield what is known of a run: a name, and texts with addresses relative to the folder of the page."""

    def link(path: Path, text: str = "", suffix: str = "") -> tuple[str, str]:
        return text or str(path), html_address(os.path.relpath(path, page_dir)) + suffix

    yield "Directory", [link(entry.run_dir, suffix="/")]
    for reasons in folder(entry.run_dir):
        yield "Reasons", [link(reasons / INDEX, "why the robot went there")]
    files = sorted(path for path in entry.run_dir.iterdir() if path.suffix in _SHOWN_FILES)
    if files:
        yield "Files", [link(path, path.name) for path in files]
    for name, text in (("Command", entry.command), ("Version", entry.code), ("Seed", entry.seed)):
        if text:
            yield name, [(text, "")]
    if repeats:
        agreement = "with the same figures" if entry.same else "not all with the same figures"
        yield "Repeats", [(f"{agreement}:", ""), *(link(repeat.run_dir, suffix="/") for repeat in repeats)]
