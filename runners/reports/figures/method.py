"""The subgoal search of LME, shown at one decision: candidates, sectors and history (paper Fig. 2)."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.geometry.frames import to_world
from lme.guides.lme.criteria import View
from lme.guides.lme.surmount import Blockage, sector_points
from lme.types import Floats, Pose
from runners.reports.figures import robot_view as view
from runners.reports.figures.driven_runs import (
    DecisionFigure,
    DecisionView,
    StepConfig,
    candidate_reach,
)
from runners.reports.figures.scene import Box, frame_panel
from runners.reports.figures.style import BLUE, GREEN, INK, SKY, VERMILION, YELLOW, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PAGE_IN, EDGE_IN, GAP_IN = 7.0, 0.08, 0.14
CAPTION_LINE_IN, CAPTION_LETTERS, CAPTION_LINES = 0.13, 44, 6  # below a panel
NEAREST_M = 1.0  # least distance shown around the robot
TURN_RAD = math.radians(30)  # by which the name of B is turned away from the target
ARCS = (0.62, 0.45)  # of the panel's half width: radii of the arcs of the smaller and the larger angle


class Method(DecisionFigure):
    """Three panels of one decision, in the robot frame with the heading up."""

    Config = StepConfig
    name = "method"

    def figure(self, shot: DecisionView) -> Figure:
        """See `DecisionFigure`."""
        return method_figure(shot)


def method_figure(shot: DecisionView) -> Figure:
    """Draw the page of one decision."""
    side = (PAGE_IN - 2 * EDGE_IN - 2 * GAP_IN) / 3
    caption_height = 0.1 + CAPTION_LINE_IN * CAPTION_LINES
    height = EDGE_IN + side + caption_height
    figure = new_figure(PAGE_IN, height, layout=None)
    for number, (box, draw) in enumerate(_panels(shot)):
        x = EDGE_IN + number * (side + GAP_IN)
        axes = figure.add_axes((x / PAGE_IN, caption_height / height, side / PAGE_IN, side / height))
        frame_panel(axes, box)
        view.draw_scale(axes, box)
        words = f"({'abc'[number]}) {draw(axes, shot)}"
        caption = textwrap.fill(words.replace(" = ", "\u00a0=\u00a0"), CAPTION_LETTERS)  # no break at "="
        style: dict[str, Any] = {"va": "top", "fontsize": 7, "color": INK, "linespacing": 1.25}
        figure.text(x / PAGE_IN, (caption_height - 0.05) / height, caption, **style)
    return figure


def _panels(shot: DecisionView) -> list[tuple[Box, Any]]:
    """Return (box, drawing function) of each panel; the function returns the caption."""
    reach = candidate_reach(shot.trace)
    reach_box = _square(np.array([[-reach, -reach], [reach, reach]]), view.MARGIN)
    blockage, history = shot.why.view.blockage, shot.why.view.history
    ends = None if blockage is None else np.array([np.zeros(2), blockage.E1, blockage.E2, blockage.B])
    # Zoom in on the blocking sector if it lies within reach, and on the remembered positions.
    sector_box = reach_box if ends is None or np.abs(ends).max() > reach else _square(ends, 2.2)
    steps = _square(np.vstack([np.zeros((1, 2)), history]), 1.0, shot.why.view.radius + 0.3)
    return [(reach_box, _draw_candidates), (sector_box, _draw_sectors), (steps, _draw_history)]


def _square(points: Floats, margin: float, beyond_m: float = 0.0) -> Box:
    """Return the square on the page around points of the robot frame, at least `NEAREST_M` to each side.

    margin: factor on their extent. beyond_m: added to each side.
    """
    page = view.upwards(points)
    low, high = page.min(axis=0), page.max(axis=0)
    half = max(margin * float((high - low).max()) / 2 + beyond_m, NEAREST_M)
    x, y = (low + high) / 2
    return Box(x - half, y - half, x + half, y + half)


def _draw_candidates(axes: Axes, shot: DecisionView) -> str:
    explanation, reach = shot.why, candidate_reach(shot.trace)
    view.draw_range(axes, explanation, reach)
    axes.plot(
        *view.upwards(explanation.candidates).T,
        "o",
        color=SKY,
        markersize=2.6,
        markeredgecolor=BLUE,
        markeredgewidth=0.3,
    )
    axes.plot(*view.upwards(explanation.view.points).T, ".", color=VERMILION, markersize=2.2, zorder=3)
    view.draw_target(axes, explanation.view.target, VERMILION, written=True)
    view.draw_robot(axes, shot.trace.robot.footprint)
    star = {**view.STAR, "markersize": 12, "markeredgecolor": INK, "markeredgewidth": 0.7}
    axes.plot(*view.upwards(explanation.decision.subgoal), color=YELLOW, zorder=10, **star)
    target_distance = math.hypot(*explanation.view.target)
    return (
        f"{len(explanation.candidates)} candidates (blue) within {reach:g} m (dotted), scan points "
        f"(orange) and the subgoal (star). The robot O heads upwards; the target T is {target_distance:.1f} m away."
    )


def _draw_sectors(axes: Axes, shot: DecisionView) -> str:
    explanation, scene = shot.why, shot.why.view
    view.draw_scan(axes, explanation, 2.6, markers=True)
    for sector, (colour, _) in zip(
        explanation.sectors, view.sector_styles(len(explanation.sectors)), strict=True
    ):
        view.draw_contour(axes, sector_points(scene.points, sector), scene.radius, colour, 0.8)
    if scene.blockage is not None:
        view.draw_contour(axes, scene.blockage.points, scene.radius, BLUE, 1.8)
        _draw_angles(axes, scene.blockage, scene.target)
        view.draw_letters(axes, _letters(scene.blockage, scene.target), 4.0, written=True)
    view.draw_target(axes, scene.target, VERMILION, written=True)
    view.draw_robot(axes, shot.trace.robot.footprint)
    ends = [] if scene.blockage is None else [scene.blockage.E1, scene.blockage.E2]
    radius_pt = _in_points(axes, shot.trace.robot.footprint.circumscribed_radius)
    view.write(axes, view.Letter("$O$", np.zeros(2), _free_side([scene.target, *ends])), radius_pt + 5)
    return (
        f"Points nearer to each other than 2r join, {len(explanation.sectors)} sectors in all. "
        f"{_describe_blockage(scene)}"
    )


def _letters(blockage: Blockage, target: Floats) -> list[view.Letter]:
    """Return the letters E1, E2, A and B, with the name of B turned away from the target's name."""
    *end_letters, ray_letter = view.letters(blockage)
    turn = -math.copysign(TURN_RAD, _angle_between(blockage.A, target))
    return [*end_letters, ray_letter._replace(away=to_world(ray_letter.away, Pose(0.0, 0.0, turn)))]


def _free_side(points: Sequence[Floats]) -> Floats:
    """Return a (2,) unit vector on the page into the widest gap between the lines from the robot to the points."""
    bearings = np.sort([math.atan2(y, x) for x, y in map(view.upwards, points)])
    # Gaps between neighbouring bearings, the last one around to the first.
    gaps = np.diff(bearings, append=bearings[0] + math.tau)
    middle = bearings[gaps.argmax()] + gaps.max() / 2
    return np.array([math.cos(middle), math.sin(middle)])


def _in_points(axes: Axes, length_m: float) -> float:
    """Return a length of the panel on the page [pt]."""
    (x0, _), (x1, _) = axes.transData.transform([(0.0, 0.0), (length_m, 0.0)])
    return float(x1 - x0) * 72 / axes.figure.dpi


def _describe_blockage(scene: View) -> str:
    if scene.blockage is None:
        return "None of them blocks the way to the target T."
    E1, E2, A = scene.blockage.E1, scene.blockage.E2, scene.blockage.A
    angle_1, angle_2 = (math.degrees(abs(_angle_between(end, scene.target))) for end in (E1, E2))
    return (
        f"The blue one blocks the way to the target T: ∠E₁OT = {angle_1:.0f}°, ∠E₂OT = {angle_2:.0f}°, so A is "
        f"{'E₁' if np.array_equal(A, E1) else 'E₂'}. B lies on the ray OA, |AB| = r = {scene.radius:.2f} m, as far as "
        "the outline."
    )


def _draw_angles(axes: Axes, blockage: Blockage, target: Floats) -> None:
    """Draw the angles between the ends and the target as arcs, solid for A, and A–B as a bar."""
    half = (axes.get_xlim()[1] - axes.get_xlim()[0]) / 2
    start = math.atan2(target[1], target[0])
    # An arc from the target to each end, and a line to the end.
    for end in (blockage.E1, blockage.E2):
        is_nearer = np.array_equal(end, blockage.A)
        angles = start + np.linspace(0.0, _angle_between(target, end), 61)
        arc = half * ARCS[0 if is_nearer else 1] * np.column_stack([np.cos(angles), np.sin(angles)])
        style: dict[str, Any] = {"linestyle": "-" if is_nearer else "--", "linewidth": 0.8, "zorder": 4}
        axes.plot(*view.upwards(arc).T, color=INK, **style)
        axes.plot(*view.upwards(np.array([[0.0, 0.0], end])).T, color=INK, **style)
    axes.plot(*view.upwards(np.array([blockage.A, blockage.B])).T, color=BLUE, linewidth=2.2, zorder=7)


def _angle_between(a: Floats, b: Floats) -> float:
    """Return the angle from a to b [rad], counter-clockwise in (−π, π]."""
    return math.atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])


def _draw_history(axes: Axes, shot: DecisionView) -> str:
    explanation, scene = shot.why, shot.why.view
    free = explanation.features[explanation.names.index("c_h")] > 0
    style: dict[str, Any] = {"markersize": 3.2, "markeredgecolor": BLUE, "markeredgewidth": 0.5}
    for mask, face in ((free, SKY), (~free, "white")):
        axes.plot(*view.upwards(explanation.candidates[mask]).T, "o", markerfacecolor=face, **style)
    axes.plot(*view.upwards(scene.points).T, ".", color=VERMILION, markersize=3, zorder=3)
    view.draw_robot(axes, shot.trace.robot.footprint)
    if len(scene.history) == 0:
        return f"None of the last {shot.history_length} positions counts: each is too near to the robot."
    view.draw_contour(axes, scene.history, scene.radius, GREEN, 0.9)
    view.draw_history(axes, scene.history, 4.5)
    return (
        f"{len(scene.history)} of the last {shot.history_length} positions are far enough away to count (green, darker "
        f"= nearer to now), outlined at r. The straight way to {int((~free).sum())} of {len(free)} candidates (open) "
        "enters the outline."
    )
