"""The robot's view and decision, drawn in the robot frame with the heading up, as in the paper's figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from lme.guides.lme.explanation import Explanation
from lme.guides.lme.surmount import Blockage, sector_points
from lme.robots import Footprint
from lme.types import Floats
from runners.reports.figures.scene import Box, outline
from runners.reports.figures.style import BLUE, GREEN, INK, PURPLE, VERMILION

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure


SECTORS = ((VERMILION, "o"), (PURPLE, "s"), (INK, "^"))  # colour and marker; neighbours never share one
MARGIN = 1.09  # the view reaches this many times the candidates' range
CELLS = 240  # of the grid that a contour is traced on, along each side
# Greens of a history: the oldest position light, the newest dark.
OLD: Floats = np.array([0.78, 0.91, 0.86])
YOUNG: Floats = np.array([0.0, 0.30, 0.22])
LETTER_PT = 8.0
HALO_PT = 2.5  # width of the white outline of letters
KEY: dict[str, Any] = {  # look of a key
    "frameon": False, "fontsize": 7, "labelcolor": INK, "borderaxespad": 0.0, "handlelength": 1.6,
}  # fmt: skip
STAR: dict[str, Any] = {"marker": "*", "linestyle": "", "markersize": 10, "markeredgecolor": "white"}


class Letter(NamedTuple):
    """A named point. away: (2,) unit vector on the page, from the point to its name."""

    text: str
    point: Floats
    away: Floats


def upwards(points: Floats) -> Floats:
    """Return points of the robot frame (x ahead, y left) on the page with the heading up: (..., 2)."""
    return np.stack([-points[..., 1], points[..., 0]], axis=-1)


def reach_box(candidates: Floats, reach_m: float) -> Box:
    """Return the view of the candidates' range; behind the robot it reaches only as far as the candidates."""
    extent_m = MARGIN * reach_m
    behind_m = min(float(candidates[:, 0].min()) - (MARGIN - 1) * reach_m, -0.2 * reach_m)
    return Box(-extent_m, max(behind_m, -extent_m), extent_m, extent_m)


def draw_scale(axes: Axes, box: Box) -> None:
    """Draw a scale bar of one metre in the lower left corner of a framed panel."""
    x, y = box.x0 + 0.04 * (box.x1 - box.x0), box.y0 + 0.04 * (box.y1 - box.y0)
    axes.plot([x, x + 1.0], [y, y], color=INK, linewidth=1.4, zorder=9, path_effects=halo())
    style: dict[str, Any] = {"fontsize": 7, "color": INK, "va": "center", "zorder": 9, "path_effects": halo()}
    axes.annotate("1 m", (x + 1.0, y), (3, 0), textcoords="offset points", **style)


def sector_styles(count: int) -> list[tuple[str, str]]:
    """Return (colour, marker) of each sector around the robot; the last sector is a neighbour of the first."""
    styles = [SECTORS[index % 3] for index in range(count)]
    if count > 1 and count % 3 == 1:
        styles[-1] = SECTORS[1]
    return styles


def draw_scan(axes: Axes, explanation: Explanation, size_pt: float, markers: bool = False) -> None:
    """Draw scan points in the colours of their sectors."""
    styles = sector_styles(len(explanation.sectors))
    for sector, (colour, marker) in zip(explanation.sectors, styles, strict=True):
        points = upwards(sector_points(explanation.view.points, sector))
        shape = marker if markers else "o"
        axes.plot(*points.T, shape, color=colour, markersize=size_pt, markeredgewidth=0, zorder=3)


def draw_contour(axes: Axes, points: Floats, radius: float, colour: str, width_pt: float = 1.2) -> None:
    """Draw the line at distance `radius` [m] from points of the robot frame."""
    x0, y0, x1, y1 = _corners(axes)
    x, y = np.linspace(x0, x1, CELLS), np.linspace(y0, y1, CELLS)
    page = np.stack(np.meshgrid(x, y), axis=-1)
    distance = np.asarray(cKDTree(upwards(points)).query(page)[0])
    if distance.min() < radius < distance.max():
        axes.contour(x, y, distance, levels=[radius], colors=[colour], linewidths=[width_pt], zorder=5)


def draw_robot(axes: Axes, footprint: Footprint) -> None:
    """Draw the footprint, and the heading as a line to its front."""
    outline_points = upwards(outline(footprint))
    axes.fill(*outline_points.T, facecolor="white", edgecolor=INK, linewidth=0.8, zorder=7)
    axes.plot([0, 0], [0, outline_points[:, 1].max()], color=INK, linewidth=0.8, zorder=7)


def draw_target(axes: Axes, target: Floats, colour: str = INK, written: bool = False) -> None:
    """Draw a line to the target T with a cross on it, or an arrow to the edge if T is outside the panel."""
    x, y = upwards(target)
    # The share of the line to the target that lies in the panel.
    visible_share = _share_inside(x, y, Box(*_corners(axes)))
    tip = target if visible_share == 1.0 else 0.98 * visible_share * target
    if visible_share == 1.0:
        axes.plot([0, x], [0, y], color=INK, linewidth=0.9, zorder=4)
        axes.plot(x, y, "x", color=colour, markersize=6, markeredgewidth=1.8, zorder=8)
    else:
        style: dict[str, Any] = {
            "arrowstyle": "-|>",
            "color": INK,
            "linewidth": 0.9,
            "shrinkA": 0,
            "shrinkB": 0,
        }
        end_x, end_y = upwards(tip)
        axes.annotate("", (end_x, end_y), (0.0, 0.0), arrowprops={**style, "mutation_scale": 7}, zorder=4)
    if written:
        normal = np.array([y, -x]) / max(math.hypot(x, y), 1e-9)
        write(axes, Letter("$T$", tip, normal), 9)


def draw_range(axes: Axes, explanation: Explanation, reach_m: float) -> None:
    """Draw the arc at the candidates' range, over the bearings of the candidates."""
    bearings = np.arctan2(explanation.candidates[:, 1], explanation.candidates[:, 0])
    angles = np.linspace(bearings.min(), bearings.max(), 181)
    arc = upwards(reach_m * np.column_stack([np.cos(angles), np.sin(angles)]))
    axes.plot(*arc.T, color=INK, linestyle=":", linewidth=0.7, zorder=1)


def draw_history(axes: Axes, history: Floats, size_pt: float) -> None:
    """Draw recent positions, oldest first; later ones are darker."""
    if len(history):
        style: dict[str, Any] = {"c": greens(len(history)), "edgecolors": INK, "linewidths": 0.3}
        x, y = upwards(history).T
        axes.scatter(x, y, s=size_pt**2, zorder=6, **style)


def greens(count: int) -> Floats:
    """Return (count, 3) colours from the oldest, light, to the newest, dark."""
    shares = np.linspace(0.0, 1.0, count)[:, None] if count > 1 else np.ones((1, 1))
    return (1 - shares) * OLD + shares * YOUNG


def draw_subgoals(axes: Axes, explanation: Explanation) -> None:
    """Draw the chosen subgoal and its rival: the old one after a switch, else the best new one."""
    rival = rival_subgoal(explanation)
    if rival is not None:
        marker, size = ("*", 9) if explanation.decision.choice.switched else ("o", 7)
        style: dict[str, Any] = {"markersize": size, "markerfacecolor": "none", "markeredgecolor": GREEN}
        axes.plot(*upwards(rival[1]), marker, zorder=9, **style)
    axes.plot(*upwards(explanation.decision.subgoal), color=GREEN, zorder=10, **STAR)


def rival_subgoal(explanation: Explanation) -> tuple[str, Floats] | None:
    """Return name and position of the subgoal that was not chosen; None at the first step."""
    if explanation.old is None:
        return None
    if explanation.decision.choice.switched:
        return "old subgoal, given up", explanation.old
    return "best new one, not taken", explanation.candidates[explanation.new]


def letters(blockage: Blockage, brief: bool = False) -> list[Letter]:
    """Return E1, E2, A and B. The end that is A is labelled "A = E1" or "A = E2"; if `brief`, only "A"."""
    ends = ((blockage.E1, "$E_1$", 1.0), (blockage.E2, "$E_2$", -1.0))  # clockwise end first
    all_letters = []
    for end, name, turn in ends:
        full_name = "$A$" if brief else f"$A$ = {name}"
        text = full_name if np.array_equal(end, blockage.A) else name
        outwards = upwards(end) / math.hypot(end[0], end[1])
        all_letters.append(Letter(text, end, turn * np.array([outwards[1], -outwards[0]])))
    all_letters.append(Letter("$B$", blockage.B, upwards(blockage.A) / math.hypot(*blockage.A)))
    return all_letters


def blockage_seen(explanation: Explanation, box: Box) -> Blockage | None:
    """Return the blocking sector if any of its points lies in the box, else None."""
    blockage = explanation.view.blockage
    if blockage is None or not any(is_inside(point, box) for point in blockage.points):
        return None
    return blockage


def draw_letters(
    axes: Axes,
    letters_drawn: Sequence[Letter],
    size_pt: float,
    written: bool,
    clear_of: Sequence[Floats] = (),
) -> None:
    """Draw marks at the ends, A and B, with names if `written`. clear_of: (2,) points that no name may hide."""
    for letter in letters_drawn:
        face = BLUE if letter.text == "$B$" else "white"
        x, y = upwards(letter.point)
        axes.plot(x, y, "o", markersize=size_pt, markerfacecolor=face, markeredgecolor=BLUE, zorder=8)
        if written and is_inside(letter.point, Box(*_corners(axes))):
            write(axes, _avoid_points(axes, letter, 7 + size_pt / 2, clear_of), 7 + size_pt / 2)


def _avoid_points(axes: Axes, letter: Letter, away_pt: float, clear_of: Sequence[Floats]) -> Letter:
    """Return the letter, moved to another side if it would hide one of these points."""
    dots = axes.figure.dpi / 72
    point, *obstacles_px = (
        axes.transData.transform(upwards(position)) for position in (letter.point, *clear_of)
    )
    x, y = letter.away
    # Try the wanted side, both sides across, and the opposite one.
    for direction in np.array([[x, y], [-y, x], [y, -x], [-x, -y]]):
        middle = point + (away_pt + LETTER_PT / 2) * dots * direction
        if all(math.dist(middle, obstacle_px) >= LETTER_PT * dots for obstacle_px in obstacles_px):
            return letter._replace(away=direction)
    return letter


def write(axes: Axes, letter: Letter, away_pt: float) -> None:
    """Write a name next to its point, moved into the panel if it would leave it."""
    dots = axes.figure.dpi / 72
    position_px = axes.transData.transform(upwards(letter.point)) + away_pt * dots * letter.away
    edge = 9 * dots
    # Keep the middle of the letter away from the edge of the panel.
    clipped_px = np.clip(position_px, np.array(axes.bbox.min) + edge, np.array(axes.bbox.max) - edge)
    x, y = axes.transData.inverted().transform(clipped_px)
    style: dict[str, Any] = {
        "fontsize": LETTER_PT,
        "color": INK,
        "va": "center",
        "zorder": 11,
        "path_effects": halo(),
    }
    away = letter.away[0]
    axes.text(x, y, letter.text, ha="left" if away > 0.35 else "right" if away < -0.35 else "center", **style)


def halo() -> list[Any]:
    """Return a white outline that keeps text readable on any background."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=HALO_PT, foreground="white")]


def is_inside(point: Floats, box: Box) -> bool:
    """Return whether a point of the robot frame lies in this box of the page."""
    x, y = upwards(point)
    return _share_inside(x, y, box) == 1.0


def _corners(axes: Axes) -> tuple[float, float, float, float]:
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    return x0, y0, x1, y1


def _share_inside(x: float, y: float, box: Box) -> float:
    """Return the largest t ≤ 1 with t·(x, y) in the box, which contains the origin."""
    share_x = (box.x1 if x > 0 else box.x0) / x if x else math.inf
    share_y = (box.y1 if y > 0 else box.y0) / y if y else math.inf
    return min(share_x, share_y, 1.0)


def key(explanation: Explanation, reach_m: float, box: Box) -> list[Any]:
    """Return the entries of the key, for the marks that the view has."""
    rival, blockage = rival_subgoal(explanation), blockage_seen(explanation, box)
    outline_style = {"marker": "*" if explanation.decision.choice.switched else "o", "markeredgecolor": GREEN}
    scan_marks = tuple(
        mark("scan, by sector", color=colour, marker="o", markersize=3, markeredgewidth=0)
        for colour, _ in SECTORS
    )
    entries = [
        mark("chosen subgoal", color=GREEN, **STAR),
        rival and mark(rival[0], markerfacecolor="none", markersize=7, **outline_style),
        mark("robot, heading up", marker="s", color="white", markeredgecolor=INK, markersize=6),
        line("target direction", color=INK, linewidth=0.9),
        is_inside(explanation.view.target, box)
        and mark("target", marker="x", color=INK, markersize=6, markeredgewidth=1.8),
        len(explanation.view.points) and scan_marks,
        blockage and line("blocking sector", color=BLUE, linewidth=1.2),
        blockage
        and mark("its ends $E_1$, $E_2$", color="white", marker="o", markeredgecolor=BLUE, markersize=4),
        blockage and mark("$B$, $r$ beyond $A$", color=BLUE, marker="o", markersize=4),
        len(explanation.view.history)
        and mark("recent positions", color=greens(2)[1], marker="o", markersize=4),
        line(f"range of candidates, {reach_m:g} m", color=INK, linestyle=":", linewidth=0.9),
    ]
    return [entry for entry in entries if entry]


def draw_key(
    figure: Figure, entries: Sequence[Any], anchor: tuple[float, float], loc: Any, **style: Any
) -> None:
    """Draw a legend with its corner or edge `loc` at this point of the page."""
    from matplotlib.legend_handler import HandlerTuple

    labels = [(entry[0] if isinstance(entry, tuple) else entry).get_label() for entry in entries]
    handlers = {tuple: HandlerTuple(ndivide=None, pad=0.0)}
    figure.legend(entries, labels, loc=loc, bbox_to_anchor=anchor, handler_map=handlers, **style)


def style_bar(bar: Colorbar, bins: int) -> None:
    """Give a colour bar thin lines and small numbers, at most `bins` of them."""
    outline_of_bar: Any = bar.outline
    outline_of_bar.set_linewidth(0.4)
    bar.ax.locator_params(nbins=bins)
    bar.ax.tick_params(labelsize=7, labelcolor=INK, length=2, width=0.5, pad=1.5)


def mark(label: str, **style: Any) -> Artist:
    """Return an entry of a key that is a point."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **{"linestyle": "", **style})


def line(label: str, **style: Any) -> Artist:
    """Return an entry of a key that is a line."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **style)
