"""The paths of a run in a sample of its worlds."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lme.worlds.world import MapSet, Task
from runners.config.quoting import lme_command, override
from runners.records.episode_record import EpisodeKey
from runners.records.launch_record import trust_flags
from runners.records.parquet import TRAJECTORIES, lacks_steps
from runners.records.records import read_trajectories
from runners.reports.analysis.summary import ablated
from runners.reports.figures.scene import (
    BESIDE_PT,
    Around,
    Box,
    aspect_of,
    best_columns,
    common_box,
    draw_obstacles,
    draw_paths,
    draw_task,
    extremes,
    lay_out,
    legend_keys,
    panel_width,
    same_size,
    wrapped,
    write,
)
from runners.reports.figures.style import INK, LEGEND_ORDER, STYLES, entitle, new_figure, page_width, save

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = 12  # at most: more cannot be read on a page
RUNS = 30  # paths in a panel at most, for the same reason
FAILED = 40  # failures at most in the overview of a building
BUILDING = "world_building"  # column: which of several buildings the world is in
BUILDING_M = 20.0  # longest side of a building, at least
KEY_LINE_IN = 0.17
FAILURES = 2 / 3  # of a sample at most, if there are enough others
PAGE_IN = (10.0, 8.0)  # at most
KEY_IN = 1.25  # of an entry of the key, on average
AROUND = Around(footer=0.42)


class _Scene(NamedTuple):
    """A building, or all worlds if they are not in buildings: its records, and its sampled tasks by number."""

    frame: pd.DataFrame
    tasks: dict[int, Task]

    @property
    def failures(self) -> list[EpisodeKey]:
        """The failures that its overview shows; a place without an overview has none."""
        return failed_episodes(self.frame) if self._is_building else []

    @property
    def _is_building(self) -> bool:
        """Return whether its worlds are several tasks in one world that is as large as a building."""
        first_world, *further_worlds = [task.world for task in self.tasks.values()]
        if self.frame["world"].nunique() < 2 or any(world is not first_world for world in further_worlds):
            return False
        return bool(np.ptp(extremes(first_world), axis=0).max() > BUILDING_M)


def draw_run(frame: pd.DataFrame, run_dir: Path, maps: MapSet, path: Path) -> list[Path]:
    """Draw the paths of a run in a sample of its worlds, reading only those. Return the files.

    Warns, and draws nothing, if the steps were deleted. frame: from `read_episodes`. maps: holds at least the worlds
    of `sample_worlds`.
    """
    if without_steps([run_dir]):
        return []
    worlds = {number: maps.task(number) for number in sample_worlds(frame)}
    failures = (key for scene in _scenes(frame, worlds) for key in scene.failures)
    episodes = list(dict.fromkeys([*sample_episodes(frame), *failures]))
    trajectories_figure(frame, read_trajectories([run_dir], episodes), worlds, path)
    return [path]


def without_steps(run_dirs: Sequence[Path]) -> bool:
    """Return whether the steps of a run were deleted, so that its paths cannot be drawn without driving.

    Warns if so.
    """
    run_dir_without = next((run_dir for run_dir in run_dirs if lacks_steps(run_dir)), None)
    if run_dir_without is None:
        return False
    command = lme_command(
        "figure trajectories", override("run", run_dir_without), *trust_flags(run_dir_without)
    )
    warnings.warn(
        f"{run_dir_without}: has no {TRAJECTORIES}, so no paths are drawn; {command} drives them again",
        stacklevel=3,
    )
    return True


def trajectories_figure(
    frame: pd.DataFrame, trajectories: pd.DataFrame, worlds: Mapping[int, Task], path: Path
) -> None:
    """Draw the paths of a run in a sample of its worlds, all at one scale, and save them as PNG.

    The first panels show buildings, each with the failures that `failed_episodes` names, in all of its worlds.
    frame: from `read_episodes`. trajectories: from `read_trajectories`, of the episodes to draw (`sample_episodes`).
    worlds: tasks by number, at least those of `sample_worlds`.
    """
    scenes = _scenes(frame, worlds)
    paths = dict(list(trajectories.groupby(["world", "run"])))
    boxes = same_size([_box(scene, trajectories) for scene in scenes])
    # Buildings get an overview of their failures, and every sampled world a panel.
    overviews = [(scene, box) for scene, box in zip(scenes, boxes, strict=True) if scene.failures]
    numbers = {
        number: box for scene, box in zip(scenes, boxes, strict=True) for number in sorted(scene.tasks)
    }
    # The overviews come first, then the worlds.
    figure = new_figure(*PAGE_IN, layout=None)
    panels = _panels(figure, [*(box for _, box in overviews), *numbers.values()])
    for scene, _ in overviews:
        _draw_failures(panels.pop(0), scene, paths)
    for number, axes in zip(numbers, panels, strict=True):
        episodes = frame[frame["world"] == number]
        draw_task(axes, worlds[number])
        draw_paths(axes, episodes, paths)
        axes.set_title(f"world {number}", fontsize=8, color=INK, pad=3)
    _label(figure, frame, len(numbers), boxes[0])
    save(figure, path.with_suffix(""))


def sample_worlds(frame: pd.DataFrame, limit: int = PANELS) -> list[int]:
    """Return at most `limit` worlds, spread over outcomes and numbers, with failures first but not alone.

    There is at least one world of each building.
    """
    buildings = _buildings(frame)
    share = max(1, limit // len(buildings))
    worst_outcomes = [_worst_outcomes(rows) for rows in buildings]
    return [
        number
        for worlds in worst_outcomes
        for number in _sample(
            {kind: [w for w, outcome in worlds.items() if outcome == kind] for kind in STYLES}, share
        )
    ]


def sample_episodes(frame: pd.DataFrame) -> list[EpisodeKey]:
    """Return the episodes of `sample_worlds`: at most `RUNS` of each, chosen among its runs in the same way."""
    episodes = []
    for world in sample_worlds(frame):
        runs = frame[frame["world"] == world]
        kinds = {kind: runs["run"][runs["outcome"] == kind].tolist() for kind in STYLES}
        episodes += [EpisodeKey(world, run) for run in _sample(kinds, RUNS)]
    return episodes


def failed_episodes(frame: pd.DataFrame) -> list[EpisodeKey]:
    """Return failed episodes: the first run that failed in each world, in at most `FAILED` worlds, evenly spaced."""
    failed = frame[frame["outcome"] != "success"].drop_duplicates("world").sort_values("world")
    keys = [EpisodeKey(world, run) for world, run in zip(failed["world"], failed["run"], strict=True)]
    return [keys[index] for index in _spread(range(len(keys)), FAILED)]


def _buildings(frame: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the records of each building of a map set of several; else all records."""
    return [rows for _, rows in frame.groupby(BUILDING)] if BUILDING in frame else [frame]


def _scenes(frame: pd.DataFrame, worlds: Mapping[int, Task]) -> list[_Scene]:
    sampled = [number for number in sample_worlds(frame) if number in worlds]
    scenes = [
        _Scene(rows, {number: worlds[number] for number in sampled if number in set(rows["world"])})
        for rows in _buildings(frame)
    ]
    return [scene for scene in scenes if scene.tasks]


def _box(scene: _Scene, trajectories: pd.DataFrame) -> Box:
    """Return the box that the panels of a place show."""
    world_numbers = {*scene.tasks, *(key.world for key in scene.failures)}
    steps = trajectories[trajectories["world"].isin(world_numbers)]
    return common_box(list(scene.tasks.values()), steps[["x_m", "y_m"]].to_numpy(float))


def _draw_failures(axes: Axes, scene: _Scene, paths: Mapping[tuple[int, int], pd.DataFrame]) -> None:
    """Draw the paths of failed episodes in one panel, with the numbers of their worlds at their ends."""
    frame, failures = scene.frame, scene.failures
    draw_obstacles(axes, next(iter(scene.tasks.values())).world)
    is_failure = frame.set_index(["world", "run"], drop=False).index.isin(
        [(key.world, key.run) for key in failures]
    )
    draw_paths(axes, frame[is_failure], paths)
    for key in failures:
        steps = paths.get((key.world, key.run))
        if steps is not None and len(steps):
            write(axes, str(key.world), steps[["x_m", "y_m"]].to_numpy()[-1].tolist(), (0.0, BESIDE_PT))
    worlds = frame["world"][frame["outcome"] != "success"].nunique()
    fewer = "" if worlds <= FAILED else f"{FAILED} of "
    axes.set_title(f"failures in {fewer}{worlds} world{'s' * (worlds > 1)}", fontsize=8, color=INK, pad=3)


def _sample(kinds: Mapping[str, Sequence[int]], limit: int) -> list[int]:
    """Return at most `limit` of the numbers, which are given by outcome."""
    num_successes = len(kinds["success"])
    failures = max(limit - num_successes, math.ceil(limit * FAILURES))
    # Timeouts are rare and most informative; collisions follow; successes fill the rest.
    timeouts = min(len(kinds["timeout"]), max(failures - len(kinds["collision"]), failures // 2))
    collisions = min(len(kinds["collision"]), failures - timeouts)
    shares = {"timeout": timeouts, "collision": collisions, "success": limit - timeouts - collisions}
    return sorted(number for kind, share in shares.items() for number in _spread(sorted(kinds[kind]), share))


def _worst_outcomes(frame: pd.DataFrame) -> dict[int, str]:
    """Return the worst outcome of any run, by world."""
    by_world = frame.groupby("world")["outcome"].agg(set)
    return {
        int(str(world)): next(kind for kind in STYLES if kind in outcomes)
        for world, outcomes in by_world.items()
    }


def _spread(numbers: Sequence[int], count: int) -> list[int]:
    """Return `count` of `numbers`, evenly spaced in their order."""
    indices = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return [numbers[index] for index in indices]


def _panels(figure: Figure, boxes: Sequence[Box]) -> list[Axes]:
    """Add panels of one size, as large as the page allows, and set the figure's size."""
    count, aspect = len(boxes), aspect_of(boxes[0])
    page = page_width(PAGE_IN[0]), PAGE_IN[1]
    columns = best_columns(count, aspect, page, AROUND)
    width = panel_width(columns, count, aspect, page, AROUND)
    entries = _key_columns(page[0])
    around = AROUND._replace(
        footer=AROUND.footer + KEY_LINE_IN * (math.ceil(len(legend_keys()) / entries) - 1)
    )
    rows = lay_out(figure, wrapped(boxes, columns), width, around, page_width(min(KEY_IN * entries, page[0])))
    return [axes for row in rows for axes in row]


def _label(figure: Figure, frame: pd.DataFrame, num_shown: int, box: Box) -> None:
    """Write the title and the counts of outcomes above, and the key below."""
    counts = frame["outcome"].value_counts()
    outcomes = ", ".join(f"{counts[kind]} {kind}" for kind in LEGEND_ORDER if counts.get(kind, 0))
    totals = [(num_shown, frame["world"].nunique(), "worlds"), (RUNS, frame["run"].nunique(), "runs")]
    fewer = ", ".join(
        f"{num_drawn} of {number} {name}" for num_drawn, number, name in totals if num_drawn < number
    )
    sample = f" · {fewer}, failures first" if fewer else ""
    summary = f"{len(frame)} episodes: {outcomes}{sample} · panel width {box.x1 - box.x0:.1f} m"
    entitle(figure, " · ".join(_names(frame)), subtitle=summary)
    keys = legend_keys()
    figure.legend(
        handles=keys,
        loc="lower center",
        ncols=_key_columns(figure.get_figwidth()),
        frameon=False,
        fontsize=8,
        labelcolor=INK,
    )


def _key_columns(width_in: float) -> int:
    return max(min(len(legend_keys()), int(width_in / KEY_IN)), 1)


def _names(frame: pd.DataFrame) -> list[str]:
    """Return the system with its ablation, the map, its subset and the robot."""
    columns = [column for column in ("system", "map", "subset", "robot") if column in frame]
    values = [", ".join(map(str, frame[column].unique())) for column in columns]
    return [value for value in (f"{values[0]} {ablated(frame)}".strip(), *values[1:]) if value]
