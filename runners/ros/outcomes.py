"""Outcomes of the simulated robot's episodes: printed, and written as a table."""

from __future__ import annotations

import csv
from pathlib import Path
from types import TracebackType
from typing import Self

from lme import metrics
from lme.types import Outcome
from runners.ros.simulator import Driven

TABLE = "outcomes.csv"
COLUMNS = (
    "world",
    "run",
    "outcome",
    "time_s",
    "barn_metric",
    "spl",
    "path_length_m",
    "min_clearance_m",
    "final_distance_m",
)
BARN = ("barn", "dynabarn")  # maps whose tables have the metric


class Outcomes:
    """Table `outcomes.csv` in a run's directory, to which episodes are added; its columns are as in `lme eval`."""

    def __init__(self, run_dir: Path) -> None:
        self._path = run_dir / TABLE
        self._successes: list[bool] = []
        self._scores: list[float] = []

    def __enter__(self) -> Self:
        self._file = self._path.open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file)
        self._rows.writerow(COLUMNS)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
        count = len(self._successes)
        if count:
            rate, scores = sum(self._successes) / count, self._scores
            metric = f", BARN metric {sum(scores) / len(scores):.3f}" if scores else ""
            print(f"{count} episodes: success {rate:.3f}{metric}. Table: {self._path}")

    def add(self, world: int, run: int, drive: Driven) -> None:
        """Print one episode and add it to the table."""
        success = drive.outcome is Outcome.SUCCESS
        score = metrics.barn_metric(success, drive.time, drive.task.optimal_time)
        spl = metrics.spl(success, drive.task.shortest_path_length, drive.path_length)
        lengths = drive.path_length, drive.min_clearance, drive.final_distance
        self._rows.writerow([world, run, drive.outcome, drive.time, score, spl, *lengths])
        self._file.flush()
        self._successes.append(success)
        # Only the worlds of BARN and DynaBARN have the metric.
        of_barn = drive.task.map_name.startswith(BARN)
        self._scores += [score] * of_barn
        metric = f"BARN metric {score:.3f}, " if of_barn else ""
        print(
            f"world {world}, run {run}: {drive.outcome} after {drive.time:.1f} s, {metric}"
            f"path {drive.path_length:.1f} m, clearance {drive.min_clearance:.2f} m",
            flush=True,
        )
