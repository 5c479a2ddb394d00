"""The paths of a run in a sample of its worlds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.worlds.world import MapSet, Task
from runners.figures.parts.layout import Around, aspect_of, best_columns, lay_out, panel_width, wrapped
from runners.figures.parts.scene import (
    BESIDE_PT,
    Box,
    common_box,
    draw_obstacles,
    draw_paths,
    draw_task,
    extremes,
    legend_keys,
    write,
)
from runners.figures.parts.style import INK, LEGEND_ORDER, STYLES, new_figure, save
from runners.records.episode_record import EpisodeKey
from runners.records.records import read_trajectories

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = 12  # at most: more cannot be read on a page
RUNS = 30  # paths in a panel at most, for the same reason
FAILED = 40  # failures at most in the panel of a building
BUILDING_M = 20.0  # longest side of a building, at least
FAILURES = 2 / 3  # of a sample at most, if there are enough others
PAGE_IN = (10.0, 8.0)  # at most
LEGEND_IN = 6.6  # minimum width for the key
AROUND = Around(header=0.55, footer=0.42)


def draw_run(frame: pd.DataFrame, run_dir: Path, maps: MapSet, path: Path) -> None:
    """Draw the paths of a run in a sample of its worlds, reading only those.

    frame: from `read_episodes`. maps: holds at least the worlds of `sample_worlds`.
    """
    worlds = {number: maps.task(number) for number in sample_worlds(frame)}
    episodes = sample_episodes(frame)
    if is_one_building(list(worlds.values())):
        episodes = list(dict.fromkeys([*episodes, *failed_episodes(frame)]))
    trajectories_figure(frame, read_trajectories([run_dir], episodes), worlds, path)


def trajectories_figure(
    frame: pd.DataFrame, trajectories: pd.DataFrame, worlds: Mapping[int, Task], path: Path
) -> None:
    """Draw the paths of a run in a sample of its worlds, all at one scale, and save them as PNG.

    In a building, the first panel shows all failures that `failed_episodes` names, in all of its worlds.
    frame: from `read_episodes`. trajectories: from `read_trajectories`, of the episodes to draw (`sample_episodes`).
    worlds: tasks by number, at least those of `sample_worlds`.
    """
    numbers = [number for number in sample_worlds(frame) if number in worlds]
    tasks = [worlds[number] for number in numbers]
    failures = failed_episodes(frame) if is_one_building(tasks) else []
    shown = trajectories if failures else trajectories[trajectories["world"].isin(numbers)]
    paths = dict(list(shown.groupby(["world", "run"])))
    box = common_box(tasks, shown[["x_m", "y_m"]].to_numpy(float))
    figure = new_figure(*PAGE_IN, layout=None)
    panels = _panels(figure, len(numbers) + bool(failures), box)
    if failures:
        _draw_failures(panels.pop(0), frame, failures, tasks[0], paths)
    for number, axes in zip(numbers, panels, strict=True):
        episodes = frame[frame["world"] == number]
        draw_task(axes, worlds[number])
        draw_paths(axes, episodes, paths)
        axes.set_title(f"world {number}", fontsize=8, color=INK, pad=3)
    _label(figure, frame, len(numbers), box)
    save(figure, path.with_suffix(""))


def sample_worlds(frame: pd.DataFrame, limit: int = PANELS) -> list[int]:
    """At most `limit` worlds, spread over outcomes and numbers. Failures go first but do not fill the sample."""
    worst = _worst_outcomes(frame)
    return _sample({kind: [w for w, outcome in worst.items() if outcome == kind] for kind in STYLES}, limit)


def sample_episodes(frame: pd.DataFrame) -> list[EpisodeKey]:
    """The episodes of `sample_worlds`: at most `RUNS` of each, chosen among its runs in the same way."""
    episodes = []
    for world in sample_worlds(frame):
        runs = frame[frame["world"] == world]
        kinds = {kind: runs["run"][runs["outcome"] == kind].tolist() for kind in STYLES}
        episodes += [EpisodeKey(world, run) for run in _sample(kinds, RUNS)]
    return episodes


def failed_episodes(frame: pd.DataFrame) -> list[EpisodeKey]:
    """Failed episodes: the first run that failed in each world, in at most `FAILED` worlds, evenly spaced."""
    failed = frame[frame["outcome"] != "success"].drop_duplicates("world").sort_values("world")
    keys = [EpisodeKey(world, run) for world, run in zip(failed["world"], failed["run"], strict=True)]
    return [keys[index] for index in _spread(range(len(keys)), FAILED)]


def is_one_building(tasks: Sequence[Task]) -> bool:
    """Whether the tasks are several, in one world that is as large as a building."""
    world = tasks[0].world
    if len(tasks) < 2 or any(task.world is not world for task in tasks):
        return False
    return bool(np.ptp(extremes(world), axis=0).max() > BUILDING_M)


def _draw_failures(
    axes: Axes,
    frame: pd.DataFrame,
    failures: Sequence[EpisodeKey],
    task: Task,
    paths: Mapping[tuple[int, int], pd.DataFrame],
) -> None:
    """Draw the paths of failed episodes in one panel, with the numbers of their worlds at their ends."""
    draw_obstacles(axes, task.world)
    chosen = frame.set_index(["world", "run"], drop=False).index.isin(
        [(key.world, key.run) for key in failures]
    )
    draw_paths(axes, frame[chosen], paths)
    for key in failures:
        steps = paths.get((key.world, key.run))
        if steps is not None and len(steps):
            write(axes, str(key.world), steps[["x_m", "y_m"]].to_numpy()[-1].tolist(), (0.0, BESIDE_PT))
    worlds = frame["world"][frame["outcome"] != "success"].nunique()
    fewer = "" if worlds <= FAILED else f"{FAILED} of "
    axes.set_title(f"failures in {fewer}{worlds} worlds", fontsize=8, color=INK, pad=3)


def _sample(kinds: Mapping[str, Sequence[int]], limit: int) -> list[int]:
    """At most `limit` of the numbers, which are given by outcome."""
    good = len(kinds["success"])
    failures = max(limit - good, math.ceil(limit * FAILURES))
    # Timeouts are rare and most informative; collisions follow; successes fill the rest.
    timeouts = min(len(kinds["timeout"]), max(failures - len(kinds["collision"]), failures // 2))
    collisions = min(len(kinds["collision"]), failures - timeouts)
    shares = {"timeout": timeouts, "collision": collisions, "success": limit - timeouts - collisions}
    return sorted(number for kind, share in shares.items() for number in _spread(sorted(kinds[kind]), share))


def _worst_outcomes(frame: pd.DataFrame) -> dict[int, str]:
    """The worst outcome of any run, by world."""
    by_world = frame.groupby("world")["outcome"].agg(set)
    return {
        int(str(world)): next(kind for kind in STYLES if kind in outcomes)
        for world, outcomes in by_world.items()
    }


def _spread(numbers: Sequence[int], count: int) -> list[int]:
    """`count` of `numbers`, evenly spaced in their order."""
    chosen = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return [numbers[index] for index in chosen]


def _panels(figure: Figure, count: int, box: Box) -> list[Axes]:
    """Add `count` equal panels, as large as the page allows; sets the figure's size."""
    columns = best_columns(count, aspect_of(box), PAGE_IN, AROUND)
    width = panel_width(columns, count, aspect_of(box), PAGE_IN, AROUND)
    rows = lay_out(figure, wrapped([box] * count, columns), width, AROUND, LEGEND_IN)
    return [axes for row in rows for axes in row]


def _label(figure: Figure, frame: pd.DataFrame, shown: int, box: Box) -> None:
    """Write the heading and the counts of outcomes above, and the key below."""
    counts = frame["outcome"].value_counts()
    outcomes = ", ".join(f"{counts[kind]} {kind}" for kind in LEGEND_ORDER if counts.get(kind, 0))
    parts = [(shown, frame["world"].nunique(), "worlds"), (RUNS, frame["run"].nunique(), "runs")]
    fewer = ", ".join(f"{some} of {number} {name}" for some, number, name in parts if some < number)
    sample = f" · {fewer}, failures first" if fewer else ""
    summary = f"{len(frame)} episodes: {outcomes}{sample} · panel width {box.x1 - box.x0:.1f} m"
    for text, from_top_in, size in ((" · ".join(_names(frame)), 0.18, 11), (summary, 0.39, 8.5)):
        y = 1 - from_top_in / figure.get_figheight()
        figure.text(0.5, y, text, ha="center", va="center", fontsize=size, color=INK)
    keys = legend_keys()
    figure.legend(
        handles=keys, loc="lower center", ncols=len(keys), frameon=False, fontsize=8.5, labelcolor=INK
    )


def _names(frame: pd.DataFrame) -> list[str]:
    columns = [column for column in ("system", "ablation", "map", "subset", "robot") if column in frame]
    values = [", ".join(map(str, frame[column].unique())) for column in columns]
    return [value for value in values if value not in ("", "none")]
