"""Where explainer pages are linked from: the results table, and an index beside them."""

from __future__ import annotations

import html
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from runners import rundirs
from runners.explaining import FOLDER, INDEX, is_failure, page_path
from runners.page.write import fill, write_whole
from runners.records import read_trajectories
from runners.summary import DASH, summarise, title
from runners.tables import to_html

if TYPE_CHECKING:
    import pandas as pd

_HEADER = ("World", "Run", "Outcome", "Time [s]", "Closest to goal [m]")
_TEXT = ("Outcome", "Page", "Job")  # columns that stand at the left
_MOST_TOLD = 3  # settings of a job that its name tells


def failed_section(frame: pd.DataFrame, place: Path) -> str:
    """The part of `table.md` in `place` on failed episodes, with links; empty where no episode has a page.

    frame: records of one or more runs, each with its `run_dir`.
    """
    explained = [Path(run_dir) for run_dir in frame["run_dir"].unique() if _has_pages(frame, Path(run_dir))]
    if not explained:
        return ""
    jobs = _job_names(frame)
    lines = [
        [*([jobs[run_dir]] if len(jobs) > 1 else []), *_cells(episode), _page_link(episode, run_dir, place)]
        for run_dir, episode in _episodes(frame[is_failure(frame)])
    ]
    header = [*(["Job"] if len(jobs) > 1 else []), *_HEADER, "Page"]
    rule = ["---" if name in _TEXT else "---:" for name in header]
    table = "\n".join(f"| {' | '.join(line)} |" for line in [header, rule, *lines]) if lines else "None."
    indexes = ", ".join(_link(run_dir / FOLDER / INDEX, place) for run_dir in explained)
    return f"\n## Failed episodes\n\n{table}\n\nAll pages: {indexes}\n"


def write_index(frame: pd.DataFrame, run_dir: Path) -> Path:
    """Write the index of the pages of one run; its path. frame: its records.

    Raises InputError where it cannot be written.
    """
    place = run_dir / FOLDER
    worst_first = frame.sort_values(["outcome", "world", "run"], key=_worst_first)
    lines = [
        f"<tr><td>{_anchor(episode, run_dir, place)}</td>"
        + "".join(f"<td>{html.escape(cell)}</td>" for cell in _cells(episode)[2:])
        + f"<td>{episode['switches']}</td></tr>"
        for _, episode in _episodes(worst_first)
        if page_path(run_dir, _item(episode)).is_file()
    ]
    header = "".join(f"<th>{name}</th>" for name in ("Episode", *_HEADER[2:], "Switches"))
    parts = {
        "TITLE": html.escape(title(frame)),
        "RUN": html.escape("/".join(run_dir.resolve().parts[-2:])),  # as MLflow names it
        "RESULTS": to_html(summarise(frame)),
        "PAGES": f"<table>\n<tr>{header}</tr>\n" + "\n".join(lines) + "\n</table>",
    }
    write_whole(place / INDEX, fill("index.html", parts))
    return place / INDEX


def _episodes(frame: pd.DataFrame) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Rows in their order with the run that each is of, and how near its goal each episode came [m]."""
    closest = _closest_m(frame)
    for episode in frame.to_dict("records"):
        key = (episode["run_dir"], *_item(episode))
        yield Path(episode["run_dir"]), {**episode, "closest_m": closest.get(key, np.nan)}


def _closest_m(frame: pd.DataFrame) -> Mapping[Any, float]:
    """Smallest distance to the goal [m] by (run_dir, world, run); none where records do not tell the goal."""
    if frame.empty or not {"goal_x_m", "goal_y_m"} <= set(frame.columns):
        return {}
    key = ["run_dir", "world", "run"]
    steps = read_trajectories([Path(run_dir) for run_dir in frame["run_dir"].unique()])
    steps = steps.merge(frame[[*key, "goal_x_m", "goal_y_m"]], on=key)
    steps["distance_m"] = np.hypot(steps["x_m"] - steps["goal_x_m"], steps["y_m"] - steps["goal_y_m"])
    return dict(steps.groupby(key)["distance_m"].min())


def _cells(episode: Mapping[str, Any]) -> list[str]:
    """What _HEADER names."""
    closest = episode["closest_m"]
    return [
        str(episode["world"]),
        str(episode["run"]),
        str(episode["outcome"]),
        f"{episode['time_s']:.1f}",
        DASH if np.isnan(closest) else f"{closest:.2f}",
    ]


def _page_link(episode: Mapping[str, Any], run_dir: Path, place: Path) -> str:
    path = page_path(run_dir, _item(episode))
    return _link(path, place) if path.is_file() else DASH


def _anchor(episode: Mapping[str, Any], run_dir: Path, place: Path) -> str:
    path = page_path(run_dir, _item(episode))
    name = f"world {episode['world']}, run {episode['run']}"
    return f'<a href="{quote(os.path.relpath(path, place))}">{name}</a>'


def _link(path: Path, place: Path) -> str:
    """A link of Markdown to a file, as it is reached from the folder `place`."""
    way = Path(os.path.relpath(path, place)).as_posix()
    return f"[{way}]({quote(way)})"


def _has_pages(frame: pd.DataFrame, run_dir: Path) -> bool:
    episodes = frame[frame["run_dir"] == str(run_dir)]
    return any(
        page_path(run_dir, item).is_file() for item in zip(episodes["world"], episodes["run"], strict=True)
    )


def _job_names(frame: pd.DataFrame) -> dict[Path, str]:
    """What tells the runs of a sweep apart, by directory: its folder, and settings that are not those of all."""
    runs = [Path(run_dir) for run_dir in frame["run_dir"].unique()]
    launches = {run_dir: rundirs.read_launch(run_dir) for run_dir in runs}
    settings = {run: launch.overrides if launch is not None else [] for run, launch in launches.items()}
    own = {
        run: [one for one in given if not all(one in others for others in settings.values())]
        for run, given in settings.items()
    }
    return {run: " ".join([run.name, *own[run][:_MOST_TOLD]]).replace("|", r"\|") for run in runs}


def _item(episode: Mapping[str, Any]) -> tuple[int, int]:
    return int(episode["world"]), int(episode["run"])


def _worst_first(column: pd.Series) -> pd.Series:
    return column == "success" if column.name == "outcome" else column
