"""Tables and pictures of the trials of a search and its race: `trials.csv`, `race.csv`, and figures."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from runners.config.space import Range, Space
from runners.records.atomic_write import replacing, write_atomically
from runners.reports.analysis.tables import csv_text, write_csv
from runners.reports.figures.style import FRAME, INK, OBSTACLE, SKY, new_figure, save, symbol
from runners.training.race import START, End, Race, Racer, driven_label, name_of, racers, worlds_driven
from runners.training.study import Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRIALS, RACE = "trials.csv", "race.csv"
POINT, LINE, BEST = "#9A9A9A", "#0072B2", "#D55E00"  # Okabe and Ito's, as in runners.reports.figures
WIDTH_IN = 7.0
_MARKS = {End.won: "*", End.finished: "o", End.worse: "x", End.outranked: "o"}
_COLUMNS = 4
MOST_DRAWN = 2_000  # trials in a picture, besides those that raced or were the best so far
_NAME_GAP = 0.045  # least distance between two names, as a share of the height


def write_trials(trials: Sequence[Trial], run_dir: Path) -> Path:
    """Write `trials.csv` and return its path.

    One row per trial: reward, values, and outcome, steps and reward on each configuration.
    """
    has_families = len({score.family for score in trials[0].scores}) > 1

    def lines() -> Iterator[dict[str, object]]:  # made twice rather than kept: there may be many
        return (_trial_line(trial, has_families) for trial in trials)

    path = run_dir / TRIALS
    with replacing(path) as draft, draft.open("w", encoding="utf-8") as file:
        write_csv(file, dict.fromkeys(name for line in lines() for name in line), lines())
    return path


def _trial_line(trial: Trial, has_families: bool) -> dict[str, object]:
    line: dict[str, object] = {"trial": trial.number, "reward": trial.reward, **trial.values}
    for score in trial.scores:
        world = f"{score.family}_{score.world}" if has_families else str(score.world)
        line |= {
            f"outcome_{world}": score.outcome,
            f"steps_{world}": score.steps,
            f"reward_{world}": score.reward,
        }
    return line


def one_drawn_in(count: int) -> int:
    """Return n if a picture shows one in n of so many trials, besides those that matter; 1 if it shows all."""
    return math.ceil(count / MOST_DRAWN)


def write_race(race: Race, run_dir: Path) -> Path:
    """Write `race.csv` and return its path: one row per candidate of each rung, the best first."""
    lines = [
        {
            "rung": number,
            "trial": "start" if trial == START else trial,
            "worlds": len(rung.places),
            "reward": reward,
            "worse_beyond_noise": trial in rung.worse,
        }
        for number, rung in enumerate(race.rungs)
        for trial, reward in rung.values.items()
    ]
    path = run_dir / RACE
    write_atomically(path, csv_text(lines))
    return path


def training_figures(trials: Sequence[Trial], importances: Mapping[str, float], run_dir: Path) -> list[Path]:
    """Save convergence and, if known, importance as PNG; return the paths."""
    paths = save(_convergence(trials), run_dir / "convergence")
    if importances:
        paths += save(_importance(importances, len(trials)), run_dir / "importance")
    return paths


def race_figure(race: Race, start: str) -> Figure:
    """Draw a line per candidate: its mean reward against the worlds driven, until it was dropped.

    start: name of the starting weights.
    """
    figure, axes = _figure(4.0)
    field = racers(race)
    step = one_drawn_in(len(field))
    for rank, racer in reversed(list(enumerate(field))):
        if racer.raced or racer.number == START or rank % step == 0:
            _line(axes, racer)
    # The axis shows the candidates that raced; the others may lie far below.
    rewards = [value for racer in field if racer.raced for value in racer.values]
    low, high = min(rewards), max(rewards)
    reward_range = max(high - low, 0.02)
    axes.set_ylim(low - 0.06 * reward_range, high + 0.06 * reward_range)
    axes.set_xlim(-0.08, len(race.rungs) - 1 + 0.3 * max(len(race.rungs) - 1, 1))
    axes.set_xticks(range(len(race.rungs)), [worlds_driven(rung) for rung in race.rungs])
    axes.set(xlabel=driven_label(race), ylabel="mean reward so far")
    _names(axes, field, start, len(race.rungs))
    raced = [racer for racer in field if racer.raced]
    worse = sum(racer.end is End.worse for racer in raced)
    title = f"{len(field)} candidates · {len(raced)} raced · {worse} of these worse beyond the noise"
    axes.set_title(title, fontsize=10)
    _race_legend(figure, race)
    return figure


def parameters_figure(
    trials: Sequence[Trial], space: Space, best: int, start: Mapping[str, float | None], raced: frozenset[int]
) -> Figure:
    """Draw the reward of every trial in the search, or of a sample of very many, against each of its values.

    best: number of the best trial. start: values by dotted key, if known. Both are marked. raced: numbers of the
    trials that entered the race.
    """
    trials = _drawn(trials, {best, *raced})
    rows = math.ceil(len(space) / _COLUMNS)
    columns = min(len(space), _COLUMNS)
    figure = new_figure(max(WIDTH_IN * columns / _COLUMNS, 3.4), 0.5 + 1.75 * rows)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for axes in panels.flat[len(space) :]:
        axes.set_visible(False)
    # One panel for each parameter, with start and best trial marked; one legend for all.
    handles_by_name: dict[str, Any] = {}
    for axes, (key, bounds) in zip(panels.flat, space.items(), strict=False):
        _panel(axes, key, bounds, trials, raced)
        if (value := start.get(key)) is not None:
            axes.axvline(value, color=BEST, linewidth=1.3, linestyle="--", label="start")
        (best_trial,) = (trial for trial in trials if trial.number == best)
        axes.plot(best_trial.values[key], best_trial.reward, "o", color=LINE, markersize=7, fillstyle="none",
                  clip_on=False, label="best trial")  # fmt: skip
        axes.set_xlim(bounds.low, bounds.high)
        handles_by_name |= {
            name: handle for handle, name in zip(*axes.get_legend_handles_labels(), strict=True)
        }
    for row in panels:
        row[0].set_ylabel("reward", fontsize=8.5)
    figure.legend(
        handles_by_name.values(),
        handles_by_name,
        loc="outside upper center",
        ncols=4,
        frameon=False,
        fontsize=8.5,
    )
    return figure


def _drawn(trials: Sequence[Trial], kept: Collection[int]) -> list[Trial]:
    """Return the `kept` trials, every trial that was the best so far, and of the others one in so many."""
    step, best, drawn = one_drawn_in(len(trials)), -math.inf, []
    for index, trial in enumerate(trials):
        if index % step == 0 or trial.reward > best or trial.number in kept:
            drawn.append(trial)
        best = max(best, trial.reward)
    return drawn


def _convergence(trials: Sequence[Trial]) -> Figure:
    """Draw the reward of each trial, and the best so far."""
    figure, axes = _figure(3.6)
    numbers = np.array([trial.number for trial in trials])
    rewards = np.array([trial.reward for trial in trials])
    best_so_far = np.maximum.accumulate(rewards)
    axes.plot(numbers, rewards, "o", color=POINT, markersize=3.5, markeredgewidth=0, label="trial")
    axes.step(numbers, best_so_far, where="post", color=LINE, linewidth=1.6, label="best so far")
    winner = int(np.argmax(rewards))
    axes.plot(
        numbers[winner], rewards[winner], "*", color=BEST, markersize=11, markeredgewidth=0, label="best"
    )
    axes.set(xlim=(-1, numbers[-1] + 1), xlabel="trial", ylabel="reward, mean of the configurations")
    axes.set_title(
        f"{len(trials)} trials · best {rewards[winner]:.3f} in trial {trials[winner].number}", fontsize=10
    )
    axes.legend(loc="lower right", frameon=False, fontsize=8.5, ncols=3)
    low, high = float(rewards.min()), float(rewards.max())
    reward_range = max(high - low, 0.02)
    axes.set_ylim(low - 0.16 * reward_range, high + 0.06 * reward_range)
    return figure


def _importance(importances: Mapping[str, float], num_trials: int) -> Figure:
    """Draw bars, the most important parameter first."""
    figure, axes = _figure(0.9 + 0.3 * len(importances))
    names = sorted(importances, key=lambda name: importances[name])
    shares = [importances[name] for name in names]
    bars = axes.barh([name.rpartition(".")[2] for name in names], shares, color=LINE, height=0.65)
    axes.bar_label(bars, fmt="%.2f", padding=3, fontsize=8.5, color=INK)
    axes.set(xlim=(0, max(shares) * 1.12 or 1.0), xlabel="importance, PED-ANOVA: best tenth against all")
    axes.set_title(f"{num_trials} trials", fontsize=10)
    axes.tick_params(axis="y", length=0)
    return figure


def _figure(height_in: float) -> tuple[Figure, Axes]:
    figure = new_figure(WIDTH_IN, height_in)
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8.5, colors=INK)
    return figure, axes


def _panel(axes: Axes, key: str, bounds: Range, trials: Sequence[Trial], raced: frozenset[int]) -> None:
    """Draw one parameter: its axis and the trials."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=7.5, colors=INK)
    axes.set_xscale("log" if bounds.log else "linear")
    axes.minorticks_off()
    axes.set_xticks([bounds.low, bounds.high], [f"{bounds.low:g}", f"{bounds.high:g}"])
    axes.set_xlabel(symbol(key.rpartition(".")[2]), fontsize=9.5, labelpad=-6)
    for name, colour, size in (("trial", FRAME, 2.6), ("raced", SKY, 3.4)):
        subset = [trial for trial in trials if (trial.number in raced) == (name == "raced")]
        if subset:
            axes.plot([t.values[key] for t in subset], [t.reward for t in subset], "o", color=colour, markersize=size,
                      markeredgewidth=0, clip_on=False, label=name)  # fmt: skip


def _line(axes: Axes, racer: Racer) -> None:
    colour, width = _racer_style(racer)
    opacity = 1.0 if racer.raced or racer.number == START else 0.6
    axes.plot(range(len(racer.values)), racer.values, color=colour, linewidth=width, alpha=opacity)
    filling = "white" if racer.end is End.outranked else colour
    axes.plot(
        len(racer.values) - 1, racer.values[-1], _MARKS[racer.end], color=colour, markerfacecolor=filling,
        markersize=11 if racer.end is End.won else 4.5, markeredgewidth=1.0, alpha=opacity,
    )  # fmt: skip


def _racer_style(racer: Racer) -> tuple[str, float]:
    """Return colour and width of a racer's line."""
    if racer.number == START:
        return BEST, 2.0
    return (LINE, 2.0) if racer.end is End.won else (OBSTACLE, 0.8)


def _names(axes: Axes, field: Sequence[Racer], start: str, rungs: int) -> None:
    """Write the names of the start and of the finalists beside their lines, without overlap."""
    low, high = axes.get_ylim()
    finalists = [racer for racer in field if len(racer.values) == rungs]
    height = -math.inf
    for racer in reversed(finalists):
        height = max((racer.values[-1] - low) / (high - low), height + _NAME_GAP)
        name = name_of(racer.number, start).replace("$", r"\$")
        special = racer.number == START or racer.end is End.won
        axes.annotate(
            f"{name}  {racer.values[-1]:.3f}", (rungs - 1, racer.values[-1]), (rungs - 1 + 0.05 * rungs, height),
            textcoords=("data", "axes fraction"), va="center", fontsize=8,
            color=_racer_style(racer)[0] if special else INK, fontweight="bold" if special else "normal",
            arrowprops={"arrowstyle": "-", "color": FRAME, "linewidth": 0.6, "shrinkB": 4.0, "relpos": (0, 0.5)},
        )  # fmt: skip


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
