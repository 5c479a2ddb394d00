"""Common part of all learners: worlds, evaluation, curves, checkpoint, and the best network so far."""

from __future__ import annotations

import csv
import io
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, Protocol, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from lme.errors import InputError
from lme.guides.lme.weight_files import NETWORK
from runners.config.schema import LearnConfig
from runners.learning.learnable import Learnable, learned_config, network_class
from runners.records.atomic_write import replacing
from runners.reports.figures.style import (
    BLUE,
    GREEN,
    INK,
    LEGEND_ORDER,
    ORANGE,
    PURPLE,
    STYLES,
    new_figure,
    save,
)
from runners.workers.executor import Map
from runners.workers.imitation_rollouts import ImitationRollout, RolloutResult
from runners.workers.progress import LearnProgress
from runners.workers.trials import extremes

CHECKPOINT, CURVES, PRESENT = "checkpoint.pt", "curves.csv", "network.onnx"
_GUIDES = 0x6775  # seeds the draw of guides separately from the episodes
_WIDTH_IN, _PANEL_IN = 7.0, 2.3  # of the picture of the curves
_COLOURS = (BLUE, ORANGE, PURPLE, GREEN)

Row = dict[str, float]
T = TypeVar("T")


class Learner(Protocol):
    """Learning algorithm; `conf/learner/` has one file for each."""

    @property
    def total(self) -> int:
        """Number of rounds or steps until the end."""

    @property
    def expert(self) -> Mapping[str, Any] | None:
        """Options of the planner and the guide of an expert to learn from, if there is one."""

    def check(self, config: LearnConfig) -> None:
        """Raise InputError if the learner cannot learn with the config."""

    def learn(self, run: Run) -> None:
        """Continue from the checkpoint of the run until `total` is done."""


class Run:
    """One training of a network. It is deterministic in its config."""

    def __init__(
        self, config: LearnConfig, run_dir: Path, start: Path | None, drive: Map, progress: LearnProgress
    ) -> None:
        """Build the network. start: path of initial weights; None: random ones. drive: maps rollouts to results."""
        torch.set_num_threads(config.threads)
        torch.manual_seed(config.seed)
        self.config = config
        self.run_dir = run_dir
        self.rows: list[Row] = []
        self.best: float | None = None
        self.sharpness = 1.0  # factor on the logits of components while the network drives
        self._drive = drive
        self._progress = progress
        self._seconds = self._cpu_seconds = 0.0  # before a resume
        self._workers: dict[int, float] = {}  # processor time of each [s]
        self._began, self._cpu_began = perf_counter(), process_time()
        self.device = device_of(config.device)
        network = network_class(config)
        self.network: Learnable = network()
        if start is not None:
            self.network.load(network.read(start))
        self.network.trained_for(learned_config(config), extremes(config.robot, config.robots))
        self.network.to(self.device)

    @property
    def seconds(self) -> float:
        """Time spent on the training [s], including that before it was resumed."""
        return self._seconds + perf_counter() - self._began

    @property
    def cpu_seconds(self) -> float:
        """Processor time of the training and its workers [s], including that before it was resumed."""
        return self._cpu_seconds + process_time() - self._cpu_began + sum(self._workers.values())

    def restore(self, take: Callable[[dict[str, Any]], T]) -> T | None:
        """Restore curves and network from the checkpoint; return what `take` makes of the learner's state in it.

        Returns None without a checkpoint. Raises InputError, naming the file, for a damaged one.
        """
        path = self.run_dir / CHECKPOINT
        if not path.is_file():
            return None
        try:
            saved = torch.load(path, map_location="cpu", weights_only=True)
            self.rows, self.best = saved["rows"], saved["best"]
            self._seconds, self._cpu_seconds = saved["seconds"], saved["cpu_seconds"]
            self.network.load_state_dict(saved["network"])
            self._progress.set_done(int(saved["done"]), self.best)
            return take(saved["state"])
        except Exception as error:  # damaged bytes can raise anything
            raise InputError(
                f"{path}: is not a checkpoint of this training, or is damaged ({type(error).__name__}): restore it, or "
                "start again in another directory"
            ) from error

    def save_checkpoint(self, done: int, row: Row | None, state: Mapping[str, Any]) -> None:
        """Write the checkpoint after `done` rounds or steps.

        row: a point of the curves, with the `success` of `judge`, if the network was evaluated. state: all that the
        learner needs to continue, made of tensors, numbers, lists and mappings.
        """
        # Keep the best network so far, and add a point to the curves.
        if row is not None:
            if self.best is None or row["success"] > self.best:
                self.best = row["success"]
                self.write(NETWORK)
            cost = {"hours": self.seconds / 3600, "cpu_hours": self.cpu_seconds / 3600}
            self.rows.append({**row, "best_success": self.best, **cost})
            write_curves(self.rows, self.run_dir / CURVES)
        saved = {
            "done": done,
            "rows": self.rows,
            "best": self.best,
            "seconds": self.seconds,
            "cpu_seconds": self.cpu_seconds,
            "network": self.network.state_dict(),
            "state": dict(state),
        }
        whole = io.BytesIO()  # torch's own error does not tell a full disk from other causes
        torch.save(saved, whole)
        with replacing(self.run_dir / CHECKPOINT) as draft:
            draft.write_bytes(whole.getbuffer())
        self._progress.set_done(done, self.best)

    def write(self, name: str = PRESENT) -> str:
        """Write the network in the format that planners and guides read; return the path."""
        path = self.run_dir / name
        with replacing(path) as draft, draft.open("wb") as file:
            type(self.network).write(self.network.weights(self.sharpness), file)
        return str(path)

    def draw_curves(self) -> Path:
        """Save the picture of the curves, and return its path."""
        return curves_figure(self.rows, self.run_dir / "curves.png")

    def describe(self, doing: str) -> None:
        """Show what the learner is doing."""
        self._progress.describe(doing)

    def judge(self) -> Row:
        """Validate the current network: return the shares of outcomes, and the success under each guide."""
        present = self.write()
        config = self.config
        configurations = self._places(0, config.validation)
        rollouts = [
            ImitationRollout(*configuration, guide, present, None)
            for configuration in configurations
            for guide in config.guides
        ]
        results = list(self.drive(rollouts, "validate"))
        outcomes = Counter(result.outcome for result in results)
        row = {outcome: outcomes[outcome] / len(results) for outcome in ("success", "collision", "timeout")}
        for guide in config.guides:
            under = [result.outcome == "success" for result in results if result.rollout.guide == guide]
            row[f"success_{guide}"] = sum(under) / len(under)
        return row

    def drive(self, rollouts: Sequence[ImitationRollout], doing: str) -> Iterator[RolloutResult]:
        """Drive the rollouts and yield their results in any order. doing: text for the progress bar."""
        for number, result in enumerate(self._drive(rollouts), 1):
            self.describe(f"{doing} {number}/{len(rollouts)}")
            worker, cpu_seconds = result.process
            if worker != os.getpid():  # the serial executor drives in this process
                self._workers[worker] = cpu_seconds
            yield result

    def places(self, first: int, count: int) -> list[tuple[str, int]]:
        """Return map sets and numbers of training worlds, from the `first` (from 0); none is a validation world."""
        return self._places(self.config.validation + first, count)

    def guides(self, part: int, count: int) -> list[str]:
        """Draw names of guides by their shares. part: part of the training; each draws different guides."""
        names, shares = list(self.config.guides), np.array(list(self.config.guides.values()))
        rng = np.random.default_rng(np.random.SeedSequence([self.config.seed, part, _GUIDES]))
        return [names[i] for i in rng.choice(len(names), count, p=shares / shares.sum())]

    def _places(self, first: int, count: int) -> list[tuple[str, int]]:
        names = [name for name, node in self.config.training.items() if node is not None]
        return [(names[i % len(names)], self.config.first_world + i) for i in range(first, first + count)]

    def generator(self, part: int) -> torch.Generator:
        """Return the generator of a part of the training, on the CPU."""
        words = np.random.SeedSequence([self.config.seed, part]).generate_state(1, np.uint64)
        return torch.Generator().manual_seed(int(words[0] >> np.uint64(1)))


def device_of(name: str) -> torch.device:
    """Return the device of a value of `device`; auto: a GPU if there is one. Raises InputError without the GPU."""
    has_cuda = torch.cuda.is_available()
    if name == "cuda" and not has_cuda:
        raise InputError("device is cuda: torch finds no GPU here; must be auto or cpu")
    return torch.device("cuda" if has_cuda and name != "cpu" else "cpu")


def descend(
    optimiser: torch.optim.Optimizer, loss: Tensor, parameters: Iterable[nn.Parameter], gradient_max: float
) -> float:
    """Take one optimiser step; return the loss. gradient_max: norm to which the gradient is clipped."""
    optimiser.zero_grad()
    torch.autograd.backward(loss)
    nn.utils.clip_grad_norm_(parameters, gradient_max)
    optimiser.step()
    return loss.item()


def write_curves(rows: Iterable[Row], path: Path) -> None:
    """Write the curves as CSV, one line for each row."""
    listed = list(rows)
    with replacing(path) as draft, draft.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(listed[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(listed)


def curves_figure(rows: Sequence[Mapping[str, float]], path: Path) -> Path:
    """Save `path` as PNG: outcomes in validation by steps and by time, and the losses and the return, if there are any.

    rows: of the curves in their order. The first key is the axis; a name with `loss` is a loss.
    """
    axis, *names = rows[0]
    losses = [name for name in names if "loss" in name]
    lines = [columns for columns in (losses, ["return"] if "return" in names else []) if columns]
    figure = new_figure(_WIDTH_IN, _PANEL_IN * (2 + len(lines)))
    panels = figure.subplots(2 + len(lines), 1, squeeze=False)[:, 0]
    by_axis, *line_panels, by_time = panels
    x_values, minutes = [row[axis] for row in rows], [60.0 * row["hours"] for row in rows]
    # Outcomes twice, losses and return in between, above the axis that they share with the first panel.
    for panel, positions in ((by_axis, x_values), (by_time, minutes)):
        for outcome in LEGEND_ORDER:
            style, shares = STYLES[outcome], [row[outcome] for row in rows]
            panel.plot(positions, shares, style.line, color=style.colour, marker=".", label=outcome)
        panel.set(ylim=(0.0, 1.0), ylabel="share in validation")
    by_axis.set_title(f"best success {rows[-1]['best_success']:.3f}", fontsize=10)
    for panel, columns in zip(line_panels, lines, strict=True):
        for name, colour in zip(columns, _COLOURS, strict=False):
            label = name.replace("_", " ")
            panel.plot(x_values, [row[name] for row in rows], color=colour, marker=".", label=label)
        panel.set_ylabel("loss" if columns is losses else columns[0])
        panel.sharex(by_axis)
    for panel in panels:
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=8.5, colors=INK)
        panel.legend(frameon=False, fontsize=8.5, ncols=4)
    for panel in (by_axis, *line_panels)[:-1]:
        panel.tick_params(labelbottom=False)
    (by_axis, *line_panels)[-1].set_xlabel(axis)
    by_time.set(
        xlim=(0.0, None), xlabel=f"minutes; {60.0 * rows[-1]['cpu_hours']:.1f} of processor time in all"
    )
    return save(figure, path.with_suffix(""))[0]
