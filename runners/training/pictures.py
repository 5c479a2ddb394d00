"""Reports of a search: `trials.csv`, and three pictures, all pure functions of its trials."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.types import Floats
from runners.config.space import Space
from runners.records.whole_file import replacing
from runners.reports.figures.style import INK, new_figure, save
from runners.training.race import START, Race
from runners.training.study import Trial

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

TRIALS, RACE = "trials.csv", "race.csv"
POINT, LINE, BEST = "#9A9A9A", "#0072B2", "#D55E00"  # Okabe and Ito's, as in runners.reports.figures
COLOURS = "cividis"  # lightness rises evenly: readable with any colour vision
WIDTH_IN = 7.0


def write_trials(trials: Sequence[Trial], run_dir: Path) -> Path:
    """Write `trials.csv` and return its path.

    One row per trial: reward, values, and outcome, steps and reward on each configuration.
    """
    path = run_dir / TRIALS
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        several = len({score.family for score in trials[0].scores}) > 1
        places = [
            f"{score.family}_{score.world}" if several else str(score.world) for score in trials[0].scores
        ]
        ends = [f"{name}_{place}" for place in places for name in ("outcome", "steps", "reward")]
        writer.writerow(["trial", "reward", *trials[0].values, *ends])
        for trial in trials:
            row = [value for score in trial.scores for value in (score.outcome, score.steps, score.reward)]
            writer.writerow([trial.number, trial.reward, *trial.values.values(), *row])
    return path


def write_race(race: Race, run_dir: Path) -> Path:
    """Write `race.csv` and return its path: one row per candidate of each rung, the best first."""
    path = run_dir / RACE
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["rung", "trial", "worlds", "reward", "worse_beyond_noise"])
        for number, rung in enumerate(race.rungs):
            for trial, reward in rung.values.items():
                name = "start" if trial == START else trial
                writer.writerow([number, name, len(rung.places), reward, trial in rung.worse])
    return path


def training_figures(
    trials: Sequence[Trial], space: Space, importances: Mapping[str, float], run_dir: Path
) -> list[Path]:
    """Save convergence, parallel coordinates and, if known, importance as PNG; return the paths."""
    paths = [run_dir / "convergence.png", run_dir / "parallel_coordinates.png"]
    convergence(trials, paths[0])
    parallel_coordinates(trials, space, paths[1])
    if importances:
        paths.append(run_dir / "importance.png")
        importance(importances, len(trials), paths[2])
    return paths


def convergence(trials: Sequence[Trial], path: Path) -> None:
    """Draw the reward of each trial, and the best so far."""
    figure, axes = _figure(3.6)
    numbers = np.array([trial.number for trial in trials])
    rewards = np.array([trial.reward for trial in trials])
    best = np.maximum.accumulate(rewards)
    axes.plot(numbers, rewards, "o", color=POINT, markersize=3.5, markeredgewidth=0, label="trial")
    axes.step(numbers, best, where="post", color=LINE, linewidth=1.6, label="best so far")
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
    room = max(high - low, 0.02)
    axes.set_ylim(low - 0.16 * room, high + 0.06 * room)
    save(figure, path.with_suffix(""))


def parallel_coordinates(trials: Sequence[Trial], space: Space, path: Path) -> None:
    """Draw one line per trial across its values, each axis over its range; better trials are brighter and on top.

    Colours follow the rank: most rewards of a good search differ by less than 0.01.
    """
    from matplotlib.collections import LineCollection

    figure, axes = _figure(3.9)
    rewards = np.array([trial.reward for trial in trials])
    order = np.argsort(rewards, kind="stable")
    columns = np.column_stack([_position(space[key], [t.values[key] for t in trials]) for key in space])
    places = np.arange(len(space), dtype=float)
    # A search over one key has one axis: each line is a dash across it.
    across = places if len(places) > 1 else np.array([-0.1, 0.1])
    columns = columns if len(places) > 1 else np.repeat(columns, 2, axis=1)
    lines = [np.column_stack([across, row]) for row in columns[order]]
    drawn = LineCollection(lines, cmap=COLOURS, linewidths=np.linspace(0.4, 1.4, len(lines)), alpha=0.8)
    drawn.set_array(np.linspace(0.0, 1.0, len(lines)))
    axes.add_collection(drawn)
    axes.plot(across, columns[order[-1]], color=BEST, linewidth=2.2, label="best")
    _axes_of(axes, space, places)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.08), frameon=False, fontsize=8.5)
    _rank_bar(figure, axes, drawn, rewards)
    axes.set_title(f"{len(trials)} trials", fontsize=10, pad=22)
    save(figure, path.with_suffix(""))


def importance(importances: Mapping[str, float], num_trials: int, path: Path) -> None:
    """Draw bars, the most important parameter first."""
    figure, axes = _figure(0.9 + 0.3 * len(importances))
    names = sorted(importances, key=lambda name: importances[name])
    shares = [importances[name] for name in names]
    bars = axes.barh([_short(name) for name in names], shares, color=LINE, height=0.65)
    axes.bar_label(bars, fmt="%.2f", padding=3, fontsize=8.5, color=INK)
    axes.set(xlim=(0, max(shares) * 1.12 or 1.0), xlabel="importance, PED-ANOVA: best tenth against all")
    axes.set_title(f"{num_trials} trials", fontsize=10)
    axes.tick_params(axis="y", length=0)
    save(figure, path.with_suffix(""))


def _rank_bar(figure: Figure, axes: Axes, drawn: LineCollection, rewards: Floats) -> None:
    """Add a colour bar with the reward at each quarter of the trials."""
    ranks = np.linspace(0.0, 1.0, 5)
    labels = [f"{reward:.3f}" for reward in np.quantile(rewards, ranks)]
    bar = figure.colorbar(drawn, ax=axes, pad=0.02, fraction=0.04, ticks=ranks)
    bar.ax.set_yticklabels(labels, fontsize=8, color=INK)
    bar.outline.set_visible(False)
    bar.set_label("reward, by quarters of the trials", fontsize=9, color=INK)


def _axes_of(axes: Axes, space: Space, places: Floats) -> None:
    """Draw one vertical axis per key, with its name below and its bounds at the ends."""
    for place, (key, found) in zip(places, space.items(), strict=True):
        axes.axvline(place, color=INK, linewidth=0.7, zorder=3)
        for value, height, side in ((found.low, -0.02, "top"), (found.high, 1.02, "bottom")):
            axes.text(place, height, f"{value:g}", ha="center", va=side, fontsize=7.5, color=INK)
        axes.text(place, -0.09, _short(key), ha="center", va="top", fontsize=9, color=INK)
        if found.log:
            axes.text(place, -0.155, "log", ha="center", va="top", fontsize=7, color=INK)
    axes.set(xlim=(places[0] - 0.3, places[-1] + 0.3), ylim=(0, 1), xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _position(found: Any, values: Sequence[float]) -> Floats:
    """Positions of values between the bounds of their range, 0 to 1."""
    scale = math.log if found.log else float
    low, high = scale(found.low), scale(found.high)
    return (np.array([scale(value) for value in values]) - low) / (high - low)


def _short(key: str) -> str:
    return key.rpartition(".")[2]


def _figure(height_in: float) -> tuple[Figure, Axes]:
    figure = new_figure(WIDTH_IN, height_in)
    axes = figure.add_subplot()
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8.5, colors=INK)
    return figure, axes
