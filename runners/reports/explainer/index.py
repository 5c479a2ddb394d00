"""The index of a run's explainer pages: its results, and a link to each page, failures first."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config.escaping import html_address, html_text
from runners.records.episode_record import EpisodeKey
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
from runners.reports.explainer.write import asset, fill, write_html

if TYPE_CHECKING:
    import pandas as pd


def write_index(frame: pd.DataFrame, run_dir: Path) -> Path:
    """Write the index of the pages of one run, and return its path. frame: records of the run.

    Raises InputError if it cannot be written.
    """
    directory = run_dir / FOLDER
    refuse_link(directory, run_dir)
    worst_first = frame.sort_values(["outcome", "world", "run"], key=_worst_first)
    # A row for each episode that has a page.
    lines = [
        f"<tr><td>{_anchor(episode, run_dir, directory)}</td>"
        + "".join(f"<td>{html_text(cell)}</td>" for cell in cells(episode)[2:])
        + f"<td>{episode['switches']}</td></tr>"
        for _, episode in episode_rows(worst_first)
        if page_path(run_dir, EpisodeKey.of(episode)).is_file()
    ]
    header = "".join(f"<th>{name}</th>" for name in ("Episode", *HEADER[2:], "Switches"))
    fields = {
        "TITLE": html_text(title(frame)),
        "STYLE": asset("index.css"),
        "RUN": html_text("/".join(run_dir.resolve().parts[-2:])),  # the name in MLflow
        "RESULTS": to_html(summarise(frame)),
        "PAGES": f"<table>\n<tr>{header}</tr>\n" + "\n".join(lines) + "\n</table>",
    }
    write_html(directory / INDEX, fill("index.html", fields))
    return directory / INDEX


def _anchor(episode: Mapping[str, Any], run_dir: Path, directory: Path) -> str:
    key = EpisodeKey.of(episode)
    path = page_path(run_dir, key)
    return f'<a href="{html_address(os.path.relpath(path, directory))}">{key}</a>'


def _worst_first(column: pd.Series) -> pd.Series:
    return column == "success" if column.name == "outcome" else column
