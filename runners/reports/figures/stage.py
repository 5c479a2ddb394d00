"""The moving parts of a panel: the robot, its scan, its subgoal, candidates and movers, at the places of a sweep."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Floats
from lme.worlds.world import Task
from runners.reports.figures.driven_runs import DrivenRun
from runners.reports.figures.paths import sample_worlds
from runners.reports.figures.scene import POINTER, outline
from runners.reports.figures.style import BLUE, INK, ORANGE, SKY, YELLOW
from runners.workers.trace import Trace, TracedStep, TraceEnd

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D


MOVER = "#444444"
BEAMS = 180  # drawn at most: more would merge into an area
CLIPPED = (5, 95)  # [percentile] the colour scale ends here, as in the paper's maps of S
TRAIL_S = 0.5  # between two outlines of a mover's trail
NOSE = 0.8 * np.array(POINTER)  # relative to half the robot; points ahead
SUBGOAL: dict[str, Any] = {"markersize": 10, "color": YELLOW, "markeredgecolor": INK, "markeredgewidth": 0.6}
SCAN: dict[str, Any] = {"color": ORANGE, "markersize": 1.5}
BEAM: dict[str, Any] = {"color": SKY, "linewidth": 0.5, "alpha": 0.55}
SAMPLED = 3  # worlds shown of a map set whose worlds differ


def index_at(trace: Trace, time_s: float) -> int:
    """Return the index of the last frame at or before this time; 0 if there is none."""
    times = np.array([frame.time for frame in trace.frames])
    return max(int(np.searchsorted(times, time_s + 1e-9, side="right")) - 1, 0)


class Stage:
    """The moving parts of one panel, drawn at one moment after another."""

    def __init__(
        self, axes: Axes, trace: Trace, colour: str = BLUE, *, beams: bool = False, candidates: bool = False
    ) -> None:
        """Create the artists. colour: of the robot. beams: draw lines from lidar to scan points instead of dots."""
        from matplotlib.collections import LineCollection, PatchCollection

        self._trace, self._frames = trace, trace.frames
        self._outline = outline(trace.robot.footprint)
        self._beams = LineCollection([], zorder=1.5, **BEAM) if beams else None
        (self._scan,) = axes.plot([], [], ".", zorder=4, **SCAN)
        self._candidates = _candidates(axes) if candidates else None
        (self._subgoal,) = axes.plot([], [], "*", zorder=6, **SUBGOAL)
        (self._robot,) = axes.fill([], [], facecolor=colour, edgecolor="white", linewidth=0.5, zorder=6)
        (self._nose,) = axes.fill([], [], facecolor="white", linewidth=0, zorder=6.5)
        self._discs = PatchCollection([], facecolor=MOVER, zorder=4)
        self._sides = LineCollection([], colors=MOVER, linewidths=1.5, zorder=4)
        for collection in (self._beams, self._discs, self._sides):
            if collection is not None:
                axes.add_collection(collection)

    @property
    def artists(self) -> list[Artist]:
        """All artists, in drawing order."""
        all_artists = [self._beams, self._candidates, self._scan, self._discs, self._sides]
        all_artists += [self._subgoal, self._robot, self._nose]
        return [artist for artist in all_artists if artist is not None]

    def show(self, index: int) -> None:
        """Show the frame with this index."""
        frame = self._frames[index]
        self._robot.set_xy(to_world(self._outline, frame.pose))
        self._nose.set_xy(to_world(NOSE * self._outline.max(axis=0), frame.pose))
        self._show_scan(frame)
        self._move(frame)
        subgoal = frame.subgoal if isinstance(frame, TracedStep) else np.full(2, math.nan)
        is_shown = not np.allclose(subgoal, self._trace.task.goal)  # the goal has its own mark
        self._subgoal.set_data(subgoal[:1] if is_shown else [], subgoal[1:] if is_shown else [])
        if self._candidates is not None:
            self._show_candidates(frame)

    def keep(self, *, scan: bool, subgoal: bool) -> None:
        """Hide the scan or the subgoal, unless it is to be kept."""
        self._subgoal.set_visible(subgoal)
        for artist in (self._scan, self._beams):
            if artist is not None:
                artist.set_visible(scan)

    def _show_scan(self, frame: TracedStep | TraceEnd) -> None:
        points = seen(frame, self._trace.robot)
        if self._beams is None:
            self._scan.set_data(*points.T)
            return
        mount = self._trace.robot.lidar.mount
        lidar = to_world(np.array([mount.x, mount.y]), frame.pose)
        hits = points[:: math.ceil(max(len(points), 1) / BEAMS)]
        self._beams.set_segments([np.vstack([lidar, hit]) for hit in hits])

    def _move(self, frame: TracedStep | TraceEnd) -> None:
        from matplotlib.patches import Circle

        circles, edges = self._trace.moving(frame)
        self._discs.set_paths([Circle((x, y), radius) for x, y, radius in circles])
        self._sides.set_segments(list(edges.reshape(-1, 2, 2)))

    def _show_candidates(self, frame: TracedStep | TraceEnd) -> None:
        """Show the candidates coloured by score, clipped at the `CLIPPED` percentiles."""
        explanation = frame.explanation if isinstance(frame, TracedStep) else None
        assert self._candidates is not None
        if explanation is None:
            self._candidates.set_offsets(np.empty((0, 2)))
            return
        low, high = np.percentile(explanation.scores, CLIPPED)
        self._candidates.set_offsets(to_world(explanation.candidates, frame.pose))
        self._candidates.set_array(np.clip((explanation.scores - low) / max(high - low, 1e-9), 0.0, 1.0))


def draw_mover_trails(axes: Axes, trace: Trace, last_frame: int) -> None:
    """Draw outlines of the movers every `TRAIL_S`, up to the frame with index `last_frame`."""
    from matplotlib.collections import LineCollection, PatchCollection
    from matplotlib.patches import Circle

    times = np.arange(0.0, trace.frames[last_frame].time, TRAIL_S)
    shapes = [trace.moving(trace.frames[index_at(trace, time)]) for time in times]
    if not shapes:
        return
    # Movers that stand still would draw the same outline again and again.
    circles = np.unique(np.vstack([geometry for geometry, _ in shapes]).round(6), axis=0)
    edges = np.unique(np.vstack([geometry for _, geometry in shapes]).round(6), axis=0)
    discs = [Circle((x, y), radius) for x, y, radius in circles]
    axes.add_collection(
        PatchCollection(discs, facecolor="none", edgecolor=MOVER, linewidth=0.5, alpha=0.6, zorder=3.5)
    )
    axes.add_collection(
        LineCollection(list(edges.reshape(-1, 2, 2)), colors=MOVER, linewidths=0.5, alpha=0.6, zorder=3.5)
    )


def stage_keys(time_text: str, colour: str, *, scan: bool, movers: bool) -> list[Line2D]:
    """Return the entries of the key for a still `Stage`. time_text: such as "at 12.5 s". colour: of the robot."""
    from matplotlib.lines import Line2D

    keys = [Line2D([], [], marker="o", linestyle="", markersize=6, color=colour, label=f"robot {time_text}")]
    if scan:
        keys.append(Line2D([], [], **BEAM, label="laser beams"))
    if movers:
        label = "moving, rings: before"
        keys.append(Line2D([], [], marker="o", linestyle="", color=MOVER, label=label))
    return keys


def seen(frame: TracedStep | TraceEnd, robot: Robot) -> Floats:
    """Return (M, 2) points that the beams hit, in the world frame [m]."""
    return to_world(obstacle_points(frame.observation.scan, robot.lidar.mount), frame.pose)


def _candidates(axes: Axes) -> Any:
    """Return an empty scatter for candidates."""
    return axes.scatter([], [], s=7, c=[], cmap="viridis", vmin=0.0, vmax=1.0, linewidths=0, zorder=3.5)


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPlace:
    """A place that is drawn.

    runs: those in its map. numbers: the worlds drawn over one another, all with the obstacles of `task`.
    """

    name: str
    runs: tuple[DrivenRun, ...]
    task: Task
    numbers: tuple[int, ...]


def places(runs: Sequence[DrivenRun], worlds: Sequence[int] = ()) -> list[DrivenPlace]:
    """Return the places to draw: each of `worlds` in each map.

    Without `worlds`: one place for a map whose worlds have the same obstacles, a sample of worlds for any other.
    Raises InputError for a world without an episode.
    """
    driven_worlds = sorted({int(number) for run in runs for number in run.frame["world"]})
    for world in worlds:
        if world not in driven_worlds:
            listing = ", ".join(map(str, driven_worlds[:12])) + (", …" if len(driven_worlds) > 12 else "")
            raise InputError(f"world is {world}: no episode was driven there, only in {listing}")
    return [
        scene
        for key in dict.fromkeys(run.place for run in runs)
        for scene in _places_of([run for run in runs if run.place == key], worlds)
    ]


def _places_of(runs: Sequence[DrivenRun], worlds: Sequence[int]) -> list[DrivenPlace]:
    """Return the places of runs in one map, which is named with its kind if it has one."""
    maps, kind = runs[0].maps, runs[0].worlds_config.map.get("kind")
    name = str(runs[0].frame["map"].iloc[0]) + (f": {kind}" if kind else "")
    numbers = sorted({int(number) for run in runs for number in run.frame["world"]})
    # Worlds that differ only in start and goal are drawn as one.
    if not worlds and len(numbers) > 1:
        task, second_task = (maps.task(number) for number in numbers[:2])
        first, second = task.world, second_task.world
        if np.array_equal(first.circles, second.circles) and np.array_equal(first.edges, second.edges):
            return [DrivenPlace(name, tuple(runs), task, tuple(numbers))]
    selected = [number for number in worlds if number in numbers]
    if not worlds:
        selected = sample_worlds(runs[0].frame, SAMPLED)
    return [
        DrivenPlace(f"{name}, world {number}", tuple(runs), maps.task(number), (number,))
        for number in selected
    ]
