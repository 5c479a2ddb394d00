"""The leaderboard as one HTML file: the systems of each setting, sortable, each with the details of its run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from runners.analysis.leaderboard import UNKNOWN, BoardEntry, Setting
from runners.analysis.summary import INTERVAL_NOTE, TIMES
from runners.config.wording import counted
from runners.explainer.leaderboard_cells import COLUMNS, breakable, cells, chips, escaped, sort_keys
from runners.explainer.leaderboard_details import details, settings_data
from runners.explainer.write import document_parts, fill, write_html

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
