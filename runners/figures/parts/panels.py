"""One panel of a figure of paths: a place, and how one system or several drove there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.types import Floats
from lme.worlds.world import Task
from runners.figures.parts.driven_runs import DrivenRun
from runners.figures.parts.places import DrivenPlace
from runners.figures.parts.scene import Box, draw_paths, draw_task, write
from runners.figures.parts.stage import SUBGOAL, Stage, draw_mover_trails, index_at
from runners.figures.parts.style import BLUE, GREEN, INK, ORANGE, PURPLE, SKY, STYLES, VERMILION, Style
from runners.workers.trace import Trace

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

SYSTEMS = (  # told apart by line as well as by colour; the marker is the outcome's
    Style(BLUE, "-", ""),
    Style(VERMILION, "--", ""),
    Style(GREEN, "-.", ""),
    Style(PURPLE, ":", ""),
    Style(ORANGE, (0, (6, 1.5, 1, 1.5, 1, 1.5)), ""),
    Style(SKY, (0, (2, 1)), ""),
)
LINE_PT = 10.5  # between the lines of text below a panel
LETTER_IN = 0.056  # about
FIRST_PT = 8.0  # from the panel's edge to the middle of the first
SCALE, METRES_IN = 0.25, 0.4  # of a panel's width at most; room for the words beside it
SMALLER = 0.75  # stars without numbers: there may be many
FAINTEST = 0.25  # opacity of the first subgoal where later ones are stronger
APART = 0.09  # of the panel's diagonal: numbered subgoals nearer to one another would hide their numbers


class Panel(NamedTuple):
    """One panel. jobs: those drawn in it."""

    title: str
    place: DrivenPlace
    jobs: tuple[DrivenRun, ...]


class Look(NamedTuple):
    """What a panel shows beside the paths.

    moment: a step, or seconds since the start; None: no scan. subgoals: none, faded or numbered. systems: the look
    of each by its label; none: paths look as their outcomes do.
    """

    moment: int | float | None = None
    subgoals: str = "none"
    systems: Mapping[str, Style] = {}  # never changed


def episodes_of(job: DrivenRun, place: DrivenPlace) -> pd.DataFrame:
    """The records of a job in a place."""
    return job.frame[job.frame["world"].isin(place.numbers)]


def steps_of(job: DrivenRun, place: DrivenPlace) -> pd.DataFrame:
    """The control steps of a job in a place."""
    return job.trajectories[job.trajectories["world"].isin(place.numbers)]


def draw_panel(axes: Axes, panel: Panel, look: Look, box: Box) -> None:
    """Everything inside a panel, and below it how each system's episodes ended."""
    draw_task(axes, panel.place.task)
    driven = [job for job in panel.jobs if not episodes_of(job, panel.place).empty]
    for job in driven:
        _draw_job(axes, job, panel.place, look, box)
    if driven:
        draw_ends(axes, driven, panel.place, look)
    else:
        middle: dict[str, Any] = {"transform": axes.transAxes, "ha": "center", "va": "center"}
        axes.text(0.5, 0.5, "not driven", fontsize=9, color=INK, backgroundcolor="white", zorder=9, **middle)


def draw_ends(axes: Axes, jobs: Sequence[DrivenRun], place: DrivenPlace, look: Look) -> None:
    """Below the panel, right: how the episodes ended, one line for each system."""
    for line, job in enumerate(jobs):
        style = look.systems.get(job.label)
        text = _ends(episodes_of(job, place), steps_of(job, place))
        axes.annotate(
            text if style is None else f"{job.label}: {text}",
            (1.0, 0.0),
            (0.0, -FIRST_PT - LINE_PT * line),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=7,
            color=INK,
            annotation_clip=False,
        )


def scale_drop_pt(panels: Sequence[Panel], look: Look, width_in: float) -> float:
    """How far below the panels the scale stands: beside the first line of text, or below narrow panels' last."""
    labels = [job.label for panel in panels for job in panel.jobs]
    is_beside = width_in * (1 - SCALE) - METRES_IN >= least_in(labels, look)
    return FIRST_PT if is_beside else FIRST_PT + LINE_PT * _lines(panels, look)


def foot_in(panels: Sequence[Panel], look: Look, width_in: float) -> float:
    """Height of what stands below each panel [in]."""
    last = max(FIRST_PT + LINE_PT * (_lines(panels, look) - 1), scale_drop_pt(panels, look, width_in))
    return (last + LINE_PT / 2) / 72


def least_in(labels: Sequence[str], look: Look) -> float:
    """The width of a panel that holds the text below it [in]."""
    longest = max((len(label) + 2 for label in labels if label in look.systems), default=0)
    return LETTER_IN * (longest + len("collision, 100.0 s"))


def _lines(panels: Sequence[Panel], look: Look) -> int:
    return max(len(panel.jobs) for panel in panels) if look.systems else 1


def ends_before(panels: Sequence[Panel], moment: float) -> bool:
    """Whether a robot that is drawn at this moment has come to its end earlier. Raises InputError where all have."""
    column = "time_s" if isinstance(moment, float) else "step"
    driven = [steps_of(job, panel.place).groupby(["world", "run"]) for panel in panels for job in panel.jobs]
    ends = [episodes[column].max().iloc[0] + 1e-9 for episodes in driven if len(episodes)]
    last = max(ends, default=0.0)
    if moment > last:
        unit = " s" if isinstance(moment, float) else ""
        raise InputError(
            f"figure.moment is {moment:g}{unit}: the longest of the episodes ends at {last:g}{unit}"
        )
    return moment > min(ends, default=0.0)


def _draw_job(axes: Axes, job: DrivenRun, place: DrivenPlace, look: Look, box: Box) -> None:
    """Paths of all episodes; subgoals, scan and what else moves of the first of them."""
    episodes, steps = episodes_of(job, place), steps_of(job, place)
    style = look.systems.get(job.label)
    paths = dict(list(steps.groupby(["world", "run"])))
    draw_paths(axes, episodes, paths, style)
    first = min(paths)
    if look.subgoals != "none":
        colour = SUBGOAL["color"] if style is None else style.colour
        _draw_subgoals(axes, subgoals_of(paths[first], place.task), colour, look.subgoals == "numbered", box)
    if look.moment is not None:
        trace = job.trace(*first)
        _draw_moment(axes, trace, look, (style or STYLES[trace.episode.outcome]).colour)


def _draw_moment(axes: Axes, trace: Trace, look: Look, colour: str) -> None:
    """The robot, what it sees and what else moves, then or at an earlier end. Systems overlaid: no scans."""
    assert look.moment is not None
    is_time = isinstance(look.moment, float)
    last = index_at(trace, look.moment) if is_time else min(int(look.moment), len(trace.steps))
    draw_mover_trails(axes, trace, last)
    stage = Stage(axes, trace, colour, beams=True)
    stage.show(last)
    stage.keep(scan=not look.systems, subgoal=look.subgoals == "none")


def subgoals_of(steps: pd.DataFrame, task: Task) -> Floats:
    """(K, 2) where the subgoals lay when they were chosen [m]; without those that are the goal itself."""
    chosen = (steps["switched"] > 0) | (steps["step"] == steps["step"].min())
    points: Floats = steps.loc[chosen, ["subgoal_x_m", "subgoal_y_m"]].dropna().to_numpy()
    to_goal: Floats = np.hypot(*(points - task.goal).T)
    return points[to_goal > task.goal_tolerance]


def _draw_subgoals(axes: Axes, points: Floats, colour: str, numbered: bool, box: Box) -> None:
    """Stars: stronger from the first to the last; or numbered from 1, those that leave room for it."""
    if numbered:
        points = _apart(points, APART * math.hypot(box.x1 - box.x0, box.y1 - box.y0))
    size = SUBGOAL["markersize"] * (1.0 if numbered else SMALLER)
    strengths = np.ones(len(points)) if numbered else np.linspace(FAINTEST, 1.0, len(points))
    for number, (point, strength) in enumerate(zip(points, strengths, strict=True), 1):
        axes.plot(*point, "*", alpha=strength, zorder=5, **{**SUBGOAL, "color": colour, "markersize": size})
        if numbered:
            write(axes, str(number), point, (7.5, 0.0))


def _apart(points: Floats, distance: float) -> Floats:
    """The points, in order, that keep this distance from all those before them."""
    kept: list[Floats] = []
    for point in points:
        if all(math.dist(point, other) >= distance for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, 2)


def _ends(episodes: pd.DataFrame, steps: pd.DataFrame) -> str:
    """Outcome and time of one episode, or how many of several arrived.

    The time counts from the start as in the key and in a film; a record's from the first decimetre where the task
    has it so.
    """
    if len(episodes) > 1:
        return f"{(episodes['outcome'] == 'success').sum()}/{len(episodes)}"
    return f"{episodes.iloc[0]['outcome']}, {steps['time_s'].max():.1f} s"
