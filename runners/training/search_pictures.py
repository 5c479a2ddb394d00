"""Two pictures of a training: its race, and each parameter against the reward."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from runners.config.space import Range, Space
from runners.reports.figures.style import FRAME, INK, OBSTACLE, SKY, new_figure, symbol
from runners.training.pictures import BEST, LINE, WIDTH_IN
from runners.training.race import START, End, Race, Racer, driven_label, name_of, racers, worlds_driven
from runners.training.study import Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKS = {End.won: "*", End.finished: "o", End.worse: "x", End.outranked: "o"}
_COLUMNS = 4
_NAME_GAP = 0.045  # least distance between two names, as a share of the height


def race_figure(race: Race, start: str) -> Figure:
    """Draw a line per candidate: its mean reward against the worlds driven, until it was dropped.

    start: name of the starting weights.
    """
    figure = new_figure(WIDTH_IN, 4.0)
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    found = racers(race)
    for racer in reversed(found):
        _line(axes, racer)
    seen = [value for racer in found if racer.raced for value in racer.values]
    low, high = min(seen), max(seen)
    room = max(high - low, 0.02)
    axes.set_ylim(low - 0.06 * room, high + 0.06 * room)
    axes.set_xlim(-0.08, len(race.rungs) - 1 + 0.3 * max(len(race.rungs) - 1, 1))
    axes.set_xticks(range(len(race.rungs)), [worlds_driven(rung) for rung in race.rungs])
    axes.tick_params(labelsize=8.5, colors=INK)
    axes.set(xlabel=driven_label(race), ylabel="mean reward so far")
    _names(axes, found, start, len(race.rungs))
    axes.set_title(_title(race, found), fontsize=10)
    _race_legend(figure, race)
    return figure


def parameters_figure(
    trials: Sequence[Trial], space: Space, best: int, start: Mapping[str, float | None], raced: frozenset[int]
) -> Figure:
    """Draw the reward of every trial in the search against each of its values.

    best: the number of the best trial. start: values by dotted key, where known. Both are marked. raced: numbers of the
    trials that entered the race.
    """
    rows = math.ceil(len(space) / _COLUMNS)
    columns = min(len(space), _COLUMNS)
    figure = new_figure(max(WIDTH_IN * columns / _COLUMNS, 3.4), 0.5 + 1.75 * rows)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for axes in panels.flat[len(space) :]:
        axes.set_visible(False)
    known: dict[str, Any] = {}
    for axes, (key, found) in zip(panels.flat, space.items(), strict=False):
        _panel(axes, key, found, trials, raced)
        if (value := start.get(key)) is not None:
            axes.axvline(value, color=BEST, linewidth=1.3, linestyle="--", label="start")
        (chosen,) = (trial for trial in trials if trial.number == best)
        axes.plot(chosen.values[key], chosen.reward, "o", color=LINE, markersize=7, fillstyle="none",
                  clip_on=False, label="best trial")  # fmt: skip
        axes.set_xlim(found.low, found.high)
        known |= {name: handle for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)}
    for row in panels:
        row[0].set_ylabel("reward", fontsize=8.5)
    figure.legend(known.values(), known, loc="outside upper center", ncols=4, frameon=False, fontsize=8.5)
    return figure


def _panel(axes: Axes, key: str, found: Range, trials: Sequence[Trial], raced: frozenset[int]) -> None:
    """One parameter: its axis and the trials."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7.5, colors=INK)
    axes.set_xscale("log" if found.log else "linear")
    axes.minorticks_off()
    axes.set_xticks([found.low, found.high], [f"{found.low:g}", f"{found.high:g}"])
    axes.set_xlabel(symbol(key.rpartition(".")[2]), fontsize=9.5, labelpad=-6)
    for name, colour, size in (("trial", FRAME, 2.6), ("raced", SKY, 3.4)):
        part = [trial for trial in trials if (trial.number in raced) == (name == "raced")]
        if part:
            axes.plot([t.values[key] for t in part], [t.reward for t in part], "o", color=colour, markersize=size,
                      markeredgewidth=0, clip_on=False, label=name)  # fmt: skip


def _line(axes: Axes, racer: Racer) -> None:
    colour, width = _look(racer)
    shown = racer.raced or racer.number == START
    axes.plot(
        range(len(racer.values)), racer.values, color=colour, linewidth=width, alpha=1.0 if shown else 0.6
    )
    axes.plot(
        len(racer.values) - 1, racer.values[-1], _MARKS[racer.end], color=colour, markerfacecolor=_filling(racer),
        markersize=11 if racer.end is End.won else 4.5, markeredgewidth=1.0, alpha=1.0 if shown else 0.6,
    )  # fmt: skip


def _look(racer: Racer) -> tuple[str, float]:
    """Colour and width of a line."""
    if racer.number == START:
        return BEST, 2.0
    return (LINE, 2.0) if racer.end is End.won else (OBSTACLE, 0.8)


def _filling(racer: Racer) -> str:
    return "white" if racer.end is End.outranked else _look(racer)[0]


def _names(axes: Axes, found: Sequence[Racer], start: str, rungs: int) -> None:
    """The names of the start and of those that came to the end, beside their lines, never over each other."""
    low, high = axes.get_ylim()
    last = [racer for racer in found if len(racer.values) == rungs]
    height = -math.inf
    for racer in reversed(last):
        height = max((racer.values[-1] - low) / (high - low), height + _NAME_GAP)
        name = name_of(racer.number, start).replace("$", r"\$")
        special = racer.number == START or racer.end is End.won
        axes.annotate(
            f"{name}  {racer.values[-1]:.3f}", (rungs - 1, racer.values[-1]), (rungs - 1 + 0.05 * rungs, height),
            textcoords=("data", "axes fraction"), va="center", fontsize=8,
            color=_look(racer)[0] if special else INK, fontweight="bold" if special else "normal",
            arrowprops={"arrowstyle": "-", "color": FRAME, "linewidth": 0.6, "shrinkB": 4.0, "relpos": (0, 0.5)},
        )  # fmt: skip


def _title(race: Race, found: Sequence[Racer]) -> str:
    worse = sum(racer.end is End.worse for racer in found if racer.raced)
    raced = sum(racer.raced for racer in found)
    return f"{len(found)} candidates · {raced} raced · {worse} of these worse beyond the noise"


def _race_legend(figure: Figure, race: Race) -> None:
    from matplotlib.lines import Line2D

    best = BEST if race.winner == START else LINE
    marks = {"winner": End.won, "worse beyond the noise": End.worse, "outranked": End.outranked}
    handles = [
        Line2D([], [], marker=_MARKS[end], color=best if end is End.won else OBSTACLE, linestyle="none", label=name,
               markersize=9 if end is End.won else 4.5, markerfacecolor="white" if end is End.outranked else None)
        for name, end in marks.items()
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", frameon=False, fontsize=8, ncols=3)
