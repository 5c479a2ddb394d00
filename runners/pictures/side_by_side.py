"""Paths of several systems side by side: one column per job of a sweep's system, one row per place."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.worlds.world import MapSet, Task
from runners import build, rundirs
from runners.pictures.scene import common_box, draw_paths, draw_task, frame_panel, legend_keys
from runners.pictures.style import INK, new_figure, save
from runners.pictures.trajectories import LEGEND_IN, sample_worlds
from runners.records import read_trajectories

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "side_by_side"
ROWS, COLUMNS = 6, 6  # at most: more cannot be read on a page
SAMPLED = 3  # worlds of a map set whose worlds differ
PANEL_IN, TALL_IN = 2.3, 10.0  # width of a panel, height of all of them, at most
FOOTER_IN, HEADER_IN, MARGIN_IN = 0.45, 0.35, 0.35


class _Job(NamedTuple):
    """One run of the sweep. place: the map's config as text, which tells places apart."""

    label: str
    place: str
    maps: MapSet
    frame: pd.DataFrame
    run_dir: Path


class _Place(NamedTuple):
    """One row of panels. numbers: the worlds drawn over one another, all with the obstacles of `task`."""

    name: str
    key: str
    task: Task
    numbers: tuple[int, ...]


def side_by_side_figure(frame: pd.DataFrame, run_dirs: Sequence[Path], folder: Path) -> list[Path]:
    """Draw the paths of every job of a sweep and save them below `folder` as PNG and PDF; the paths.

    Draws nothing where there is one system, or more systems than fit on a page.
    """
    jobs = [job for run_dir in run_dirs if (job := _job(frame, run_dir)) is not None]
    columns = list(dict.fromkeys(job.label for job in jobs))
    if not 1 < len(columns) <= COLUMNS:
        return []
    figure = _drawn(jobs, columns, _places(jobs)[:ROWS])
    return save(figure, folder / NAME, ("png", "pdf"))


def _job(frame: pd.DataFrame, run_dir: Path) -> _Job | None:
    launch = rundirs.read_launch(run_dir)
    records = frame[frame["run_dir"] == str(run_dir)]
    if launch is None or records.empty:
        return None
    config: Mapping[str, Any] = launch.configs[0]
    first = records.iloc[0]
    ablation = "" if first.get("ablation", "none") == "none" else f", {first['ablation']}"
    place = json.dumps([config["map"], config["robot"]["footprint"]], sort_keys=True)
    return _Job(f"{first['system']}{ablation}", place, build.map_set(config), records, run_dir)


def _places(jobs: Sequence[_Job]) -> list[_Place]:
    """One for each map whose worlds are all alike; some worlds of one whose worlds differ."""
    places = []
    for key in dict.fromkeys(job.place for job in jobs):
        here = [job for job in jobs if job.place == key]
        name, maps = str(here[0].frame["map"].iloc[0]), here[0].maps
        numbers = sorted({int(number) for job in here for number in job.frame["world"]})
        tasks = [maps.task(number) for number in numbers[:2]]
        if len(tasks) > 1 and _same_obstacles(*tasks):
            places.append(_Place(_with_kind(name, key), key, tasks[0], tuple(numbers)))
            continue
        for number in sample_worlds(here[0].frame, SAMPLED):
            places.append(_Place(f"{name} {number}", key, maps.task(number), (number,)))
    return places


def _with_kind(name: str, key: str) -> str:
    """A map set that comes in kinds, by its kind."""
    kind = json.loads(key)[0].get("kind")
    return f"{name}: {kind}" if kind else name


def _same_obstacles(one: Task, other: Task) -> bool:
    return np.array_equal(one.world.circles, other.world.circles) and np.array_equal(
        one.world.edges, other.world.edges
    )


def _drawn(jobs: Sequence[_Job], columns: Sequence[str], places: Sequence[_Place]) -> Figure:
    paths = {job.run_dir: read_trajectories([job.run_dir]) for job in jobs}
    boxes = [common_box([place.task], np.vstack(_points(jobs, paths, place))) for place in places]
    aspects = [(box.y1 - box.y0) / (box.x1 - box.x0) for box in boxes]
    width = min(PANEL_IN, TALL_IN / sum(aspects))
    heights = [width * aspect for aspect in aspects]
    size = (MARGIN_IN + width * len(columns), sum(heights) + HEADER_IN + FOOTER_IN)
    figure = new_figure(max(size[0], LEGEND_IN), size[1])
    panels = figure.subplots(len(places), len(columns), squeeze=False, height_ratios=heights)
    for row, (place, box) in enumerate(zip(places, boxes, strict=True)):
        for column, label in enumerate(columns):
            axes = panels[row][column]
            frame_panel(axes, box)
            draw_task(axes, place.task)
            for job in jobs:
                if (job.label, job.place) == (label, place.key):
                    _draw_job(axes, job, paths[job.run_dir], place)
        panels[row][0].set_ylabel(place.name, fontsize=8, color=INK)
    for column, label in enumerate(columns):
        panels[0][column].set_title(label, fontsize=9, color=INK)
    figure.legend(
        handles=legend_keys(),
        loc="outside lower center",
        ncols=6,
        frameon=False,
        fontsize=7.5,
        labelcolor=INK,
    )
    return figure


def _points(jobs: Sequence[_Job], paths: Mapping[Path, pd.DataFrame], place: _Place) -> list[Any]:
    """(N, 2) positions of every job in a place."""
    shown = [paths[job.run_dir] for job in jobs if job.place == place.key]
    return [each.loc[each["world"].isin(place.numbers), ["x_m", "y_m"]].to_numpy() for each in shown]


def _draw_job(axes: Axes, job: _Job, trajectories: pd.DataFrame, place: _Place) -> None:
    episodes = job.frame[job.frame["world"].isin(place.numbers)]
    shown = trajectories[trajectories["world"].isin(place.numbers)]
    draw_paths(axes, episodes, dict(list(shown.groupby(["world", "run"]))))
    arrived = int((episodes["outcome"] == "success").sum())
    axes.text(
        0.98, 0.02, f"{arrived}/{len(episodes)}", transform=axes.transAxes, ha="right", fontsize=7, color=INK
    )


@dataclass(slots=True)
class SideBySideConfig:
    """Nothing to choose yet."""


class SideBySide:
    Config = SideBySideConfig
    name = "trajectories"
    drives = True

    def __init__(self, config):
        pass

    def draw(self, jobs, worlds, stem, formats):
        return side_by_side_figure(
            __import__("pandas").concat([j.frame for j in jobs]), [j.run_dir for j in jobs], stem.parent
        )
