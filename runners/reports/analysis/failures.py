"""The sections of a results table on failed episodes: what happened in each, worst first, and how time-outs end."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError
from lme.navigation.episode import TRAJECTORY_COLUMNS
from lme.types import Floats, Outcome
from runners.config.escaping import html_address, markdown_table, markdown_text
from runners.config.quoting import lme_command
from runners.records import launch_record
from runners.records.episode_record import KEY_COLUMNS, EpisodeKey
from runners.records.records import read_trajectories
from runners.reports.analysis.summary import DASH, as_text, row_keys
from runners.reports.analysis.text_table import TextTable
from runners.reports.analysis.what_happened import ORDER, UP_TO_M, what_happened

if TYPE_CHECKING:
    import pandas as pd


FOLDER, INDEX = "explain", "index.html"
HEADER = ("World", "Run", "Outcome", "Time [s]", "Closest to goal [m]", "What happened")  # headers of `cells`
_EPISODE = ["run_dir", *KEY_COLUMNS]
_TEXT = ("Outcome", "Page", "Job", "What happened")  # left-aligned columns
_MAX_SETTINGS = 3  # in the name of a job
EXTENT, LAST_S = "last_minute_m", 60.0
CLASSES = ("stands", "to and fro", "on its way")


def page_path(run_dir: Path, key: EpisodeKey) -> Path:
    """Return the default path of an episode's page."""
    return run_dir / FOLDER / f"{key.world}-{key.run}.html"


def folder(run_dir: Path) -> list[Path]:
    """Return the folder of a run's pages in a list, which is empty if there is none."""
    return [run_dir / FOLDER] if (run_dir / FOLDER / INDEX).is_file() else []


def refuse_link(path: Path, run_dir: Path) -> None:
    """Raise InputError if the folder of a run's pages is a link, which could lead anywhere in another user's run."""
    if path == run_dir / FOLDER and path.is_symlink():
        raise InputError(
            f"{path}: is a link to {path.readlink()}; remove it, or write the pages elsewhere with --output"
        )


def is_failure(episodes: pd.DataFrame) -> pd.Series:
    """Return a mask of the episodes that did not reach the goal."""
    return episodes["outcome"] != str(Outcome.SUCCESS)


def pointer(frame: pd.DataFrame, run_dir: Path) -> str:
    """Return the line with the command that explains failed episodes; empty if none failed or they have pages."""
    number = int(is_failure(frame).sum())
    if not number or folder(run_dir):
        return ""
    episodes = "episode" if number == 1 else f"{number} episodes"
    return f"Why the {episodes} failed, worst first: {lme_command('explain', run_dir)}"


def failed_section(frame: pd.DataFrame, directory: Path) -> str:
    """Return the section of `directory`/table.md on failed episodes, with links; empty if no episode has a page.

    frame: records of one or more runs, with their `run_dir`.
    """
    with_pages = [Path(run_dir) for run_dir in frame["run_dir"].unique() if _has_pages(frame, Path(run_dir))]
    if not with_pages:
        return ""
    # A row for each failure, with the job in a sweep.
    jobs = _job_names(frame)
    lines = []
    for run_dir, episode in episode_rows(frame[is_failure(frame)]):
        job = [jobs[run_dir]] if len(jobs) > 1 else []
        page = page_path(run_dir, EpisodeKey.of(episode))
        link = _link(page, directory) if page.is_file() else DASH
        lines.append([*job, *map(markdown_text, cells(episode)), link])
    header = [*(["Job"] if len(jobs) > 1 else []), *HEADER, "Page"]
    rule = ["---" if name in _TEXT else "---:" for name in header]
    table = markdown_table([header, rule, *lines]) if lines else "None."
    indexes = ", ".join(_link(run_dir / FOLDER / INDEX, directory) for run_dir in with_pages)
    order = f"{ORDER} " if len(lines) > 1 else ""
    return f"\n## Failed episodes\n\n{table}\n\n{order}All pages: {indexes}\n"


def episode_rows(frame: pd.DataFrame) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the run directory and the row of each episode, worst first.

    Each row also has its smallest distance to the goal, `closest_m` [m], and `what_happened`.
    """
    if frame.empty:
        return
    # The control steps of all episodes, which a run may have deleted.
    keys = {EpisodeKey.of(row) for row in frame[list(KEY_COLUMNS)].to_dict("records")}
    trajectories = read_trajectories([Path(run_dir) for run_dir in frame["run_dir"].unique()], keys)
    columns = list(TRAJECTORY_COLUMNS)
    steps = {
        key: group.reindex(columns=columns).to_numpy(float)
        for key, group in trajectories.groupby(_EPISODE, sort=False)
    }
    rows = []
    for episode in frame.to_dict("records"):
        trajectory = steps.get(tuple(episode[name] for name in _EPISODE), np.empty((0, len(columns))))
        account = what_happened(episode, trajectory)
        row = {**episode, "closest_m": _closest_m(episode, trajectory), "what_happened": account.sentence}
        rows.append((account.rank, row["world"], row["run"], row))
    for *_, row in sorted(rows, key=lambda ranked: ranked[:3]):
        yield Path(row["run_dir"]), row


def cells(episode: Mapping[str, Any]) -> list[str]:
    """Return the cells of a table for one episode of `episode_rows`."""
    closest = episode["closest_m"]
    return [
        str(episode["world"]),
        str(episode["run"]),
        str(episode["outcome"]),
        f"{episode['time_s']:.1f}",
        DASH if np.isnan(closest) else f"{closest:.2f}",
        str(episode["what_happened"]),
    ]


def _closest_m(episode: Mapping[str, Any], trajectory: Floats) -> float:
    """Return the smallest distance to the goal [m]; NaN without control steps or without a goal in the record."""
    if "goal_x_m" not in episode or not len(trajectory):
        return float("nan")
    x, y = (trajectory[:, TRAJECTORY_COLUMNS.index(name)] for name in ("x_m", "y_m"))
    return float(np.hypot(x - episode["goal_x_m"], y - episode["goal_y_m"]).min())


def _link(path: Path, directory: Path) -> str:
    """Return a Markdown link to a file, relative to `directory`."""
    relative = Path(os.path.relpath(path, directory)).as_posix()
    return f"[{markdown_text(relative)}]({html_address(relative)})"


def _has_pages(frame: pd.DataFrame, run_dir: Path) -> bool:
    if not (run_dir / FOLDER).is_dir():
        return False
    episodes = frame[frame["run_dir"] == str(run_dir)]
    keys = map(EpisodeKey.of, episodes[list(KEY_COLUMNS)].to_dict("records"))
    return any(page_path(run_dir, key).is_file() for key in keys)


def _job_names(frame: pd.DataFrame) -> dict[Path, str]:
    """Return a name for each run of a sweep, by directory: its folder, and the settings that not all runs share."""
    runs = [Path(run_dir) for run_dir in frame["run_dir"].unique()]
    launches = {run_dir: launch_record.read_launch(run_dir) for run_dir in runs}
    settings = {run: launch.overrides if launch is not None else [] for run, launch in launches.items()}
    counts = Counter(setting for run_settings in settings.values() for setting in set(run_settings))
    distinguishing = {
        run: [setting for setting in run_settings if counts[setting] < len(settings)]
        for run, run_settings in settings.items()
    }
    return {run: markdown_text(" ".join([run.name, *distinguishing[run][:_MAX_SETTINGS]])) for run in runs}


def timeouts_section(frame: pd.DataFrame) -> str:
    """Return the section on time-outs; empty unless one of them was driving for more than a minute.

    frame: records of one or more runs.
    """
    if EXTENT not in frame:
        return ""
    timeouts = frame[(frame["outcome"] == Outcome.TIMEOUT) & frame[EXTENT].notna()]
    if not (timeouts["time_s"] > LAST_S).any():
        return ""
    keys = ["system", *row_keys(frame)]
    # Classify each time-out by how far the robot moved in its last minute, and count the classes in each row.
    kinds = np.searchsorted(UP_TO_M, timeouts[EXTENT], side="right")
    counts = timeouts.assign(kind=kinds, **{key: as_text(timeouts[key]) for key in keys}).groupby(
        keys, sort=False
    )
    rows = [
        [
            *map(str, values),
            str(len(group)),
            *(str((group["kind"] == kind).sum()) for kind in range(len(CLASSES))),
        ]
        for values, group in counts
    ]
    header = [*(key.capitalize() if key.isidentifier() else key for key in keys), "Time-outs", *CLASSES]
    standing, paces = UP_TO_M
    note = f"By the last minute: the robot stayed within {standing:g} m, within {paces:g} m, or went farther."
    table = TextTable(header, rows, left=range(len(keys))).to_markdown()
    return f"\n## Time-outs\n\n{table}\n\n{note}\n"
