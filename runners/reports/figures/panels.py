"""One panel of a figure of paths: a place, and the paths of one or more systems there."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.types import Floats, Outcome
from lme.worlds.world import Task
from runners.config.escaping import plot_text
from runners.reports.figures.driven_runs import DrivenRun
from runners.reports.figures.scene import Box, draw_paths, draw_task, write
from runners.reports.figures.stage import SUBGOAL, DrivenPlace, Stage, draw_mover_trails, index_at
from runners.reports.figures.style import BLUE, GREEN, INK, ORANGE, PURPLE, SKY, STYLES, VERMILION, Style
from runners.workers.trace import Trace

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

SYSTEMS = (  # differ by line style as well as by colour; the marker shows the outcome
    Style(BLUE, "-", ""),
    Style(VERMILION, "--", ""),
    Style(GREEN, "-.", ""),
    Style(PURPLE, ":", ""),
    Style(ORANGE, (0, (6, 1.5, 1, 1.5, 1, 1.5)), ""),
    Style(SKY, (0, (2, 1)), ""),
)
LINE_PT = 10.5  # between the lines of text below a panel
LETTER_IN = 0.056  # approximate width of a letter
FIRST_PT = 8.0  # from the panel's edge to the middle of the first line
SCALE, METRES_IN = 0.25, 0.4  # of a panel's width at most; space for the length next to it
SMALLER = 0.75  # size of stars without numbers, of which there may be many
FAINTEST = 0.25  # opacity of the first subgoal where later ones are stronger
APART = 0.09  # of the panel's diagonal: numbered subgoals closer than this would hide their numbers


class Panel(NamedTuple):
    """A panel. runs: those that are drawn in it."""

    title: str
    place: DrivenPlace
    runs: tuple[DrivenRun, ...]


class TrajectoryStyle(NamedTuple):
    """The parts of a panel that are shown besides the paths.

    moment: a step, or seconds since the start; None: no scan. subgoals: none, faded or numbered. systems: style of
    each system by label; empty: outcomes decide the styles.
    """

    moment: int | float | None = None
    subgoals: str = "none"
    systems: Mapping[str, Style] = {}  # never modified


def episodes_of(run: DrivenRun, place: DrivenPlace) -> pd.DataFrame:
    """Return the records of a run in a place."""
    return run.frame[run.frame["world"].isin(place.numbers)]


def steps_of(run: DrivenRun, place: DrivenPlace) -> pd.DataFrame:
    """Return the control steps of a run in a place."""
    return run.steps(place.numbers)


def draw_panel(axes: Axes, panel: Panel, look: TrajectoryStyle, box: Box) -> None:
    """Draw everything inside a panel and, below it, the outcomes of each system."""
    draw_task(axes, panel.place.task)
    runs_here = [run for run in panel.runs if not episodes_of(run, panel.place).empty]
    for run in runs_here:
        _draw_run(axes, run, panel.place, look, box)
    if runs_here:
        draw_ends(axes, runs_here, panel.place, look)
    else:
        middle: dict[str, Any] = {"transform": axes.transAxes, "ha": "center", "va": "center"}
        axes.text(0.5, 0.5, "not driven", fontsize=9, color=INK, backgroundcolor="white", zorder=9, **middle)


def draw_ends(axes: Axes, runs: Sequence[DrivenRun], place: DrivenPlace, look: TrajectoryStyle) -> None:
    """Write the outcomes at the lower right of the panel, one line per system.

    Of one episode, the outcome and the time; of several, the number of successes. The time counts from the start, as
    in the key and in a film. The time in a record may start later, with the clock of the task.
    """
    for line, run in enumerate(runs):
        style = look.systems.get(run.label)
        outcomes = episodes_of(run, place)["outcome"]
        if len(outcomes) > 1:
            text = f"{(outcomes == 'success').sum()}/{len(outcomes)}"
        else:
            text = f"{outcomes.iloc[0]}, {steps_of(run, place)['time_s'].max():.1f} s"
        axes.annotate(
            text if style is None else plot_text(f"{run.label}: {text}"),
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


def scale_drop_pt(panels: Sequence[Panel], look: TrajectoryStyle, width_in: float) -> float:
    """Return the distance of the scale bar below a panel [pt]: next to the first line of text, or below the last."""
    labels = [run.label for panel in panels for run in panel.runs]
    is_beside = width_in * (1 - SCALE) - METRES_IN >= least_in(labels, look)
    return FIRST_PT if is_beside else FIRST_PT + LINE_PT * _lines(panels)


def footer_height_in(panels: Sequence[Panel], look: TrajectoryStyle, width_in: float) -> float:
    """Return the height of the texts and the scale bar below each panel [in]."""
    last_line_pt = max(FIRST_PT + LINE_PT * (_lines(panels) - 1), scale_drop_pt(panels, look, width_in))
    return (last_line_pt + LINE_PT / 2) / 72


def least_in(labels: Sequence[str], look: TrajectoryStyle) -> float:
    """Return the least width of a panel that holds the text below it [in]."""
    longest = max((len(label) + 2 for label in labels if label in look.systems), default=0)
    return LETTER_IN * (longest + len("collision, 100.0 s"))


def _lines(panels: Sequence[Panel]) -> int:
    return max(len(panel.runs) for panel in panels)


def ends_before(panels: Sequence[Panel], moment: float) -> bool:
    """Return whether any of the drawn episodes ended before this moment. Raises InputError if all of them did."""
    column = "time_s" if isinstance(moment, float) else "step"
    episodes_by_run = [
        steps_of(run, panel.place).groupby(["world", "run"]) for panel in panels for run in panel.runs
    ]
    durations = [episodes[column].max().iloc[0] + 1e-9 for episodes in episodes_by_run if len(episodes)]
    longest = max(durations, default=0.0)
    if moment > longest:
        unit = " s" if isinstance(moment, float) else ""
        raise InputError(
            f"figure.moment is {moment:g}{unit}: the longest of the episodes ends at {longest:g}{unit}"
        )
    return moment > min(durations, default=0.0)


def _draw_run(axes: Axes, run: DrivenRun, place: DrivenPlace, look: TrajectoryStyle, box: Box) -> None:
    """Draw the paths of all episodes, and subgoals, scan and movers of the first one."""
    episodes, steps = episodes_of(run, place), steps_of(run, place)
    style = look.systems.get(run.label)
    paths = dict(list(steps.groupby(["world", "run"])))
    draw_paths(axes, episodes, paths, style)
    first_episode = min(paths)
    if look.subgoals != "none":
        colour = SUBGOAL["color"] if style is None else style.colour
        _draw_subgoals(
            axes, subgoals_of(paths[first_episode], place.task), colour, look.subgoals == "numbered", box
        )
    if look.moment is not None:
        trace = run.trace(*first_episode)
        _draw_moment(axes, trace, look, (style or STYLES[Outcome(trace.episode.outcome)]).colour)


def _draw_moment(axes: Axes, trace: Trace, look: TrajectoryStyle, colour: str) -> None:
    """Draw the robot, its scan and movers at the moment or at an earlier end. Overlaid systems get no scans."""
    assert look.moment is not None
    is_time = isinstance(look.moment, float)
    # An episode that ended before shows its end.
    last_frame = index_at(trace, look.moment) if is_time else min(int(look.moment), len(trace.steps))
    draw_mover_trails(axes, trace, last_frame)
    stage = Stage(axes, trace, colour, beams=True)
    stage.show(last_frame)
    stage.keep(scan=not look.systems, subgoal=look.subgoals == "none")


def subgoals_of(steps: pd.DataFrame, task: Task) -> Floats:
    """Return the (K, 2) positions of subgoals when they were chosen [m], without those at the goal."""
    is_new = (steps["switched"] > 0) | (steps["step"] == steps["step"].min())
    points: Floats = steps.loc[is_new, ["subgoal_x_m", "subgoal_y_m"]].dropna().to_numpy()
    to_goal: Floats = np.hypot(*(points - task.goal).T)
    return points[to_goal > task.goal_tolerance]


def _draw_subgoals(axes: Axes, points: Floats, colour: str, is_numbered: bool, box: Box) -> None:
    """Draw stars that grow stronger from first to last, or some of them numbered from 1."""
    if is_numbered:
        points = _keep_apart(points, APART * math.hypot(box.x1 - box.x0, box.y1 - box.y0))
    size = SUBGOAL["markersize"] * (1.0 if is_numbered else SMALLER)
    strengths = np.ones(len(points)) if is_numbered else np.linspace(FAINTEST, 1.0, len(points))
    for number, (point, strength) in enumerate(zip(points, strengths, strict=True), 1):
        axes.plot(*point, "*", alpha=strength, zorder=5, **{**SUBGOAL, "color": colour, "markersize": size})
        if is_numbered:
            write(axes, str(number), point, (7.5, 0.0))


def _keep_apart(points: Floats, distance: float) -> Floats:
    """Return the points, in order, that are at least this far from all points kept before them."""
    spaced: list[Floats] = []
    for point in points:
        if all(math.dist(point, neighbour) >= distance for neighbour in spaced):
            spaced.append(point)
    return np.array(spaced).reshape(-1, 2)
