"""The expected time to the target that LME+ finds at one decision, with its points and candidates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from lme.geometry.frames import to_robot
from lme.guides.lme.explanation import Explanation
from lme.guides.lme.maintenance import Choice
from lme.guides.lme_plus.criteria import Perception
from lme.guides.lme_plus.guide import LmePlus
from lme.types import Floats
from runners.config import build
from runners.reports.figures import robot_view as view
from runners.reports.figures.driven_runs import (
    DecisionFigure,
    DecisionView,
    Guided,
    StepConfig,
    candidate_reach,
)
from runners.reports.figures.robot_view import draw_key, line, mark
from runners.reports.figures.scene import Box, frame_panel
from runners.reports.figures.style import BLUE, FRAME, GREEN, INK, VERMILION, new_figure
from runners.workers.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_IN, EDGE_IN, GAP_IN, WIDE_IN, BAR_IN = 7.0, 0.08, 0.2, 4.9, 0.1
CANDIDATES = "viridis"  # as in the other figures
FIELD, PALEST, DARKEST = "BuPu", 0.05, 0.55  # its pale part, on which points and candidates stand out
BESIDE, BEHIND = 0.72, 0.35  # of the view ahead
LINES, NAMED = 20, 4  # most lines of equal time; every NAMED-th has a label
CLIPPED = (5, 100)  # [percentile] ends of the colour scale of scores
SAME_M = 1e-6  # [m] a known point this near to a scan point is the same point


def telling_step(trace: Trace) -> int:
    """Return the step of the most telling decision: the switch to a better subgoal with the longest detour.

    Without such a switch, it is the step with the longest detour.
    """
    views = sights(trace, len(trace.steps) - 1)
    return max(range(len(views)), key=lambda step: (_switched(trace, step), _detour(views[step]), -step))


LME_PLUS = Guided(LmePlus, "LME+", "lme_plus", telling_step)


class ExpectedTime(DecisionFigure):
    """The field of expected times in the robot frame with the heading up, and the decision that is based on it."""

    Config = StepConfig
    name = "expected_time"
    guided = LME_PLUS

    def figure(self, shot: DecisionView) -> Figure:
        """See `DecisionFigure`."""
        return expected_time_figure(shot)


def sights(trace: Trace, last_step: int) -> list[Perception]:
    """Recompute the input of the criteria at each step up to the `last_step`, from the observations."""
    guide = build.navigator(trace.config).guide
    assert isinstance(guide, LmePlus)
    guide.reset(np.random.default_rng(0))  # the field does not depend on the candidates
    all_sights = []
    for step in trace.steps[: last_step + 1]:
        guide.guide(step.observation)
        sight = guide.sight
        assert sight is not None
        all_sights.append(sight._replace(field=sight.field.kept()))
    return all_sights


def expected_time_figure(shot: DecisionView) -> Figure:
    """Draw the page of one decision."""
    explanation, sight = shot.why, sights(shot.trace, shot.step)[-1]
    box = _box(shot)
    axes_height = WIDE_IN * (box.y1 - box.y0) / (box.x1 - box.x0)
    height = axes_height + 2 * EDGE_IN
    figure = new_figure(PAGE_IN, height, layout=None)
    axes = figure.add_axes((EDGE_IN / PAGE_IN, EDGE_IN / height, WIDE_IN / PAGE_IN, axes_height / height))
    frame_panel(axes, box)
    # From the bottom up: the field, candidates, points, then what the view shows of every decision.
    bars = [_draw_field(axes, sight), _draw_candidates(axes, explanation)]
    _draw_points(axes, explanation, sight)
    view.draw_range(axes, explanation, candidate_reach(shot.trace))
    view.draw_target(axes, explanation.view.target, written=True)
    view.draw_robot(axes, shot.trace.robot.footprint)
    view.draw_subgoals(axes, explanation)
    view.draw_scale(axes, box)
    _draw_side(figure, bars, explanation, EDGE_IN + axes_height)
    return figure


def _box(shot: DecisionView) -> Box:
    """Return the range of candidates ahead, part of it to the sides, and less behind unless the target is there."""
    extent = view.MARGIN * candidate_reach(shot.trace)
    rear = min(1.1 * float(shot.why.view.target[0]), -BEHIND * extent)
    return Box(-BESIDE * extent, max(rear, -extent), BESIDE * extent, extent)


def _switched(trace: Trace, step: int) -> bool:
    explanation = trace.steps[step].explanation
    return explanation is not None and explanation.decision.choice is Choice.BETTER


def _detour(sight: Perception) -> float:
    """Return the expected time beyond that of the straight line to the target [s]; 0 if no way is known."""
    straight = math.dist(sight.field.here, sight.field.target) / sight.v_max
    return sight.field.robot_time - straight if math.isfinite(sight.field.robot_time) else 0.0


def _draw_field(axes: Axes, sight: Perception) -> Any:
    """Draw T in colours with lines of equal time, and the fastest way; return what the colour bar shows."""
    from matplotlib import colormaps
    from matplotlib.colors import ListedColormap
    from matplotlib.ticker import MaxNLocator

    times, grid = sight.field.times[1:-1, 1:-1], sight.field.grid
    edges = grid.cell * np.arange(grid.size + 1)
    corners, centres = (_on_page(sight, edges + shift) for shift in (0.0, grid.cell / 2))
    # The colours span the times that can be seen, so that far cells do not pale the rest.
    finite = np.ma.masked_invalid(times)
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    x, y = centres[:-1, :-1].transpose(2, 0, 1)
    visible_times = finite[(x0 < x) & (x < x1) & (y0 < y) & (y < y1)]
    span: dict[str, Any] = {"vmin": visible_times.min(), "vmax": visible_times.max()}
    pale = ListedColormap(colormaps[FIELD](np.linspace(PALEST, DARKEST, 256)))
    mesh = axes.pcolormesh(*corners.transpose(2, 0, 1), finite, cmap=pale, rasterized=True, zorder=0, **span)
    levels = np.asarray(MaxNLocator(LINES, steps=[1, 2.5, 5, 10]).tick_values(span["vmin"], span["vmax"]))
    lines = axes.contour(x, y, finite, levels=levels, colors=INK, linewidths=0.4, zorder=1)
    # Label one line in NAMED.
    is_labelled = np.round(levels / (levels[1] - levels[0])) % NAMED == 0
    axes.clabel(lines, levels[is_labelled], fontsize=7, fmt="%g s")
    path = view.upwards(sight.field.descent(sight.pose, 2.0 * grid.cell * grid.size)[0])
    axes.plot(*np.vstack([[0.0, 0.0], path]).T, color=INK, linestyle="--", linewidth=1.2, zorder=5)
    return mesh


def _on_page(sight: Perception, offset: Any) -> Floats:
    """Return (K, K, 2) page coordinates of the points at these (K,) distances from the grid's corner on both axes."""
    grid = sight.field.grid
    positions = np.stack(np.meshgrid(grid.x + offset, grid.y + offset, indexing="ij"), axis=-1)
    return view.upwards(to_robot(positions.reshape(-1, 2), sight.pose)).reshape(*positions.shape)


def _draw_candidates(axes: Axes, explanation: Explanation) -> Any:
    """Draw reachable candidates coloured by score, the others as rings; return what the colour bar shows."""
    reachable = np.asarray(explanation.features[explanation.names.index("c_o")] > 0.0)
    x, y = view.upwards(explanation.candidates).T
    axes.scatter(
        x[~reachable], y[~reachable], s=14, facecolors="none", edgecolors=INK, linewidths=0.5, zorder=4
    )
    score_gap = explanation.scores[reachable] - explanation.scores.max()
    low, high = np.percentile(score_gap, CLIPPED) if len(score_gap) else (0.0, 1.0)
    style: dict[str, Any] = {"edgecolors": INK, "linewidths": 0.4, "zorder": 6, "vmin": low, "vmax": high}
    return axes.scatter(x[reachable], y[reachable], s=22, c=score_gap, cmap=CANDIDATES, **style)


def _draw_points(axes: Axes, explanation: Explanation, sight: Perception) -> None:
    """Draw the points of the scan, and those that are remembered."""
    scan = explanation.view.points
    remembered = sight.points
    # Points of the scan are remembered as well: draw them once.
    if len(scan):
        remembered = remembered[cKDTree(scan).query(remembered)[0] > SAME_M]
    for points, colour in ((remembered, BLUE), (scan, VERMILION)):
        axes.plot(*view.upwards(points).T, "o", color=colour, markersize=2.2, markeredgewidth=0, zorder=3)


def _draw_side(figure: Figure, bars: Sequence[Any], explanation: Explanation, top: float) -> None:
    """Draw colour bars and the key next to the panel, from `top` [in] down."""
    height = figure.get_figheight()
    left, width = EDGE_IN + WIDE_IN + GAP_IN, PAGE_IN - 2 * EDGE_IN - WIDE_IN - 2 * GAP_IN
    titles = ("expected time to the target [s]", "score below the best")
    for number, (artist, title) in enumerate(zip(bars, titles, strict=True)):
        y = top - 0.3 - 0.55 * number
        cax_box = (left / PAGE_IN, y / height, width / PAGE_IN, BAR_IN / height)
        bar = figure.colorbar(artist, cax=figure.add_axes(cax_box), orientation="horizontal")
        view.style_bar(bar, 5)
        bar.ax.set_title(title, fontsize=7, color=INK, pad=3)
    at_key = (left / PAGE_IN, (top - 1.15) / height)
    draw_key(figure, _key(explanation), at_key, "upper left", labelspacing=0.45, **view.KEY)


def _key(explanation: Explanation) -> list[Any]:
    from matplotlib.patches import Patch

    rival = view.rival_subgoal(explanation)
    outline_style = {"marker": "*" if explanation.decision.choice.switched else "o", "markeredgecolor": GREEN}
    ring = {"marker": "o", "markersize": 4, "markeredgecolor": INK, "markeredgewidth": 0.5}
    entries = [
        mark("chosen subgoal", color=GREEN, **view.STAR),
        rival and mark(rival[0], markerfacecolor="none", markersize=7, **outline_style),
        mark("reachable candidate", color="#21918c", **ring),
        mark("candidate, not reachable", color="none", **ring),
        mark("point of the scan", color=VERMILION, marker="o", markersize=3, markeredgewidth=0),
        mark("remembered point", color=BLUE, marker="o", markersize=3, markeredgewidth=0),
        Patch(facecolor="white", edgecolor=FRAME, label="no passage, or not searched"),
        line("fastest way", color=INK, linestyle="--", linewidth=1.2),
        line("line of equal time", color=INK, linewidth=0.4),
        line("target direction", color=INK, linewidth=0.9),
        mark("robot, heading up", marker="s", color="white", markeredgecolor=INK, markersize=6),
        line("range of candidates", color=INK, linestyle=":", linewidth=0.9),
    ]
    return [entry for entry in entries if entry]
