"""The key of a robot view: an entry for each mark that the view has."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from lme.policies.lme.explanation import Explanation
from runners.figures.parts.robot_view import SECTORS, STAR, blockage_seen, greens, is_inside, rival_subgoal
from runners.figures.parts.scene import Box
from runners.figures.parts.style import BLUE, GREEN, INK

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure


def key(why: Explanation, reach_m: float, box: Box) -> list[Any]:
    """Entries of the key, for the marks that the view has."""
    rival, blockage = rival_subgoal(why), blockage_seen(why, box)
    outlined = {"marker": "*" if why.decision.choice.switched else "o", "markeredgecolor": GREEN}
    entries = [
        mark("chosen subgoal", color=GREEN, **STAR),
        rival and mark(rival[0], markerfacecolor="none", markersize=7, **outlined),
        mark("robot, heading up", marker="s", color="white", markeredgecolor=INK, markersize=6),
        line("target direction", color=INK, linewidth=0.9),
        is_inside(why.view.target, box)
        and mark("target", marker="x", color=INK, markersize=6, markeredgewidth=1.8),
        len(why.view.points) and _sectors_mark("scan, by sector", "ooo"),
        blockage and line("blocking sector", color=BLUE, linewidth=1.2),
        blockage
        and mark("its ends $E_1$, $E_2$", color="white", marker="o", markeredgecolor=BLUE, markersize=4),
        blockage and mark("$B$, $r$ beyond $A$", color=BLUE, marker="o", markersize=4),
        len(why.view.history) and mark("recent positions", color=greens(2)[1], marker="o", markersize=4),
        line(f"range of candidates, {reach_m:g} m", color=INK, linestyle=":", linewidth=0.9),
    ]
    return [entry for entry in entries if entry]


def _sectors_mark(label: str, markers: str) -> tuple[Any, ...]:
    """One entry of a key with a mark in each sector colour."""
    colours = [colour for colour, _ in SECTORS]
    return tuple(
        mark(label, color=colour, marker=marker, markersize=3, markeredgewidth=0)
        for colour, marker in zip(colours, markers, strict=True)
    )


def draw_key(figure: Figure, entries: Sequence[Any], at: tuple[float, float], loc: Any, **look: Any) -> None:
    """Draw a legend with its corner or edge `loc` at this point of the page."""
    from matplotlib.legend_handler import HandlerTuple

    labels = [(entry[0] if isinstance(entry, tuple) else entry).get_label() for entry in entries]
    handlers = {tuple: HandlerTuple(ndivide=None, pad=0.0)}
    figure.legend(entries, labels, loc=loc, bbox_to_anchor=at, handler_map=handlers, **look)


def mark(label: str, **look: Any) -> Artist:
    """An entry of a key: a point."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **{"linestyle": "", **look})


def line(label: str, **look: Any) -> Artist:
    """An entry of a key: a line."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **look)
