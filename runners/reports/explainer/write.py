"""Write the trace of an episode as one HTML file that needs no server, network or other file, and a run's index.

The index has the results, and a link to each page, worst first, with what happened.
"""

from __future__ import annotations

import base64
import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError
from lme.guides.lme.explanation import reason
from runners.config.escaping import html_address, html_text
from runners.records.atomic_write import write_atomically
from runners.records.episode_record import KEY_COLUMNS, EpisodeKey
from runners.reports.analysis.failures import (
    FOLDER,
    HEADER,
    INDEX,
    cells,
    episode_rows,
    page_path,
    refuse_link,
)
from runners.reports.analysis.summary import summarise
from runners.reports.analysis.tables import title, to_html
from runners.reports.analysis.what_happened import ORDER, what_happened
from runners.reports.explainer.encode import encode, episode_title
from runners.workers.trace import Trace

if TYPE_CHECKING:
    import pandas as pd


ASSETS = Path(__file__).parent / "assets"
STYLES = ("uplot/uPlot.min.css", "style.css")
SCRIPTS = (  # in this order: each may use those before it
    "data.js",
    "drawn.js",
    "score.js",
    "colours.js",
    "theme.js",
    "format.js",
    "meanings.js",
    "camera.js",
    "marks.js",
    "ground.js",
    "scene.js",
    "pointer.js",
    "bars.js",
    "timeline.js",
    "parameters.js",
    "legend.js",
    "words.js",
    "playback.js",
    "keyboard.js",
    "main.js",
)
LIBRARY, LICENCE = "uplot/uPlot.iife.min.js", "uplot/LICENSE"


def write_page(
    trace: Trace,
    path: Path,
    system: str = "",
    ending: str = "",
    play: str = "",
    record: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Write the explainer page of an episode. Raises InputError if the file cannot be written.

    system: its name in tables. ending: text after the page. play: argument of `lme play`: "RUN 282/1", or the name of
    a recording beside the page, which finds out its own location; "" for none. record: its row of `episodes.parquet`,
    if there is one.
    """
    write_html(path, page(trace, sentences(trace), system, play, account(trace, record)) + ending)


def write_html(path: Path, text: str) -> None:
    """Write a page or an index, either whole or not at all. Raises InputError if the file cannot be written."""
    try:
        write_atomically(path, text)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}): choose another path") from error


def sentences(trace: Trace) -> list[str]:
    """Return the reason for every decision of LME, as text; an empty list for other guides."""
    reasons = [step.explanation for step in trace.steps]
    pairs = zip([None, *reasons], reasons, strict=False)
    return [reason(explanation, history) for history, explanation in pairs if explanation is not None]


def account(trace: Trace, record: Mapping[str, Any] = MappingProxyType({})) -> str:
    """Return the sentence about what happened in the episode. record: as in `write_page`."""
    drive, goal = trace.episode, np.asarray(trace.task.goal)
    path = drive.trajectory[:, 1:3]
    row = {
        "outcome": drive.outcome,
        "steps": len(trace.steps),
        "no_free_candidate": sum(step.guidance.blocked for step in trace.steps),
        "contact_part": getattr(drive, "contact_part", ""),
        "final_distance_m": float(np.hypot(*(path[-1] - goal))),
        "path_length_m": float(np.hypot(*np.diff(path, axis=0).T).sum()),
        "shortest_path_length_m": trace.task.shortest_path_length,
    }
    recorded = {name: value for name, value in record.items() if value != ""}  # older records name no side
    return what_happened({**row, **recorded}, drive.trajectory).sentence


def page(trace: Trace, reasons: Sequence[str], system: str = "", play: str = "", story: str = "") -> str:
    """Return the HTML of the page.

    reasons: one sentence per decision. system, play: as in `write_page`. story: a sentence about the episode.
    """
    style = "\n".join(asset(name) for name in STYLES)
    scripts = "\n".join(asset(name) for name in SCRIPTS)
    script = f'/*\n{asset(LICENCE)}*/\n{asset(LIBRARY)}\n(() => {{\n"use strict";\n{scripts}\n}})();'
    fields = {
        "TITLE": html_text(episode_title(trace)),
        "POLICY": content_security_policy(style, script),
        "STYLE": style,
        "DATA": encode(trace, reasons, system, play, story),
        "SCRIPT": script,
    }
    return fill("page.html", fields)


def fill(name: str, fields: Mapping[str, str]) -> str:
    """Return an asset in which each NAME in double braces is replaced by its part."""
    return re.sub(r"{{([A-Z]+)}}", lambda match: fields[match[1]], asset(name))


def document_parts(title: str, styles: Sequence[str], scripts: Sequence[str]) -> dict[str, str]:
    """Return HEAD and SCRIPT of a page that shows no episode. title: text. styles, scripts: names of assets."""
    style = "\n".join(map(asset, styles))
    script = '(() => {{\n"use strict";\n{}\n}})();'.format("\n".join(map(asset, scripts)))
    policy = content_security_policy(style, script)
    head = fill("head.html", {"POLICY": policy, "TITLE": html_text(title), "STYLE": style})
    return {"HEAD": head, "SCRIPT": script}


def content_security_policy(style: str, script: str) -> str:
    """Return the content security policy: this style, this script, and no connections."""
    return (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)}; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}'"


def asset(name: str) -> str:
    """Return the text of a file that pages are made of."""
    return (ASSETS / name).read_text(encoding="utf-8")


def write_index(frame: pd.DataFrame, run_dir: Path) -> Path:
    """Write the index of the pages of one run, and return its path. frame: records of the run.

    Raises InputError if it cannot be written.
    """
    directory = run_dir / FOLDER
    refuse_link(directory, run_dir)
    # A row for each episode that has a page.
    keys = map(EpisodeKey.of, frame[list(KEY_COLUMNS)].to_dict("records"))
    with_page = frame[[page_path(run_dir, key).is_file() for key in keys]]
    lines = [
        f"<tr><td>{_anchor(episode, run_dir, directory)}</td>"
        + "".join(f"<td>{html_text(cell)}</td>" for cell in cells(episode)[2:])
        + "</tr>"
        for _, episode in episode_rows(with_page)
    ]
    header = "".join(f"<th>{name}</th>" for name in ("Episode", *HEADER[2:]))
    fields = {
        "TITLE": html_text(title(frame)),
        "STYLE": asset("index.css"),
        "RUN": html_text("/".join(run_dir.resolve().parts[-2:])),  # the name in MLflow
        "RESULTS": to_html(summarise(frame)),
        "ORDER": ORDER,
        "PAGES": f'<table class="accounts">\n<tr>{header}</tr>\n' + "\n".join(lines) + "\n</table>",
    }
    write_html(directory / INDEX, fill("index.html", fields))
    return directory / INDEX


def _anchor(episode: Mapping[str, Any], run_dir: Path, directory: Path) -> str:
    key = EpisodeKey.of(episode)
    path = page_path(run_dir, key)
    return f'<a href="{html_address(os.path.relpath(path, directory))}">{key}</a>'
