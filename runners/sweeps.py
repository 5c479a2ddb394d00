"""What a sweep comes to: one table, one chart, and the results in the sweep's own tracked run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from omegaconf import DictConfig

from runners import rundirs
from runners.records import find_runs, read_episodes
from runners.summary import Row, numbers, summarise
from runners.targets import build as build_target

if TYPE_CHECKING:
    import pandas as pd

_NO_METRIC_NAME = re.compile(r"[^\w\-. /]")  # MLflow refuses the rest


class Report(NamedTuple):
    """What was written, and what is to be said below the table."""

    files: list[Path]
    words: list[str]


def finish(config: DictConfig, sweep_dir: Path, run_dirs: Sequence[Path]) -> None:
    """Tabulate, draw, print and book all runs of a sweep. config: of its first job."""
    from runners.tables import print_table

    run_dirs = find_runs(run_dirs)
    frame = read_episodes(run_dirs)
    order = list(config.table)
    artifacts, words = report(frame, order, run_dirs, sweep_dir)
    print_table(frame, order)
    for line in words:
        print(line)
    print(f"The sweep's table and pictures: {sweep_dir}")
    _book(config, frame, artifacts, sweep_dir, run_dirs)


def report(frame: pd.DataFrame, order: Sequence[str], run_dirs: Sequence[Path], place: Path) -> Report:
    """Write table and pictures of several runs into `place`, and what their ablations and scales come to."""
    from runners.pictures.comparison import comparison_figure
    from runners.pictures.side_by_side import side_by_side_figure
    from runners.tables import write_tables

    files = [
        *write_tables(frame, place, order),
        *comparison_figure(frame, order, place),
        *side_by_side_figure(frame, run_dirs, place),
    ]
    parts = [Report(files, []), _ablation(frame, place), _sensitivity(frame, place)]
    return Report(
        [file for part in parts for file in part.files], [line for part in parts for line in part.words]
    )


def _ablation(frame: pd.DataFrame, place: Path) -> Report:
    """Of what was driven complete and with something missing."""
    from runners import ablation
    from runners.pictures.ablation import ablation_figure

    found = ablation.studies(frame)
    if not found:
        return Report([], [])
    return Report([*ablation.write(found, place), *ablation_figure(found, place)], ablation.words(found))


def _sensitivity(frame: pd.DataFrame, place: Path) -> Report:
    """Of what was driven with parameters as they are and with one multiplied."""
    from runners import sensitivity
    from runners.pictures.sensitivity import sensitivity_figure

    found = sensitivity.studies(frame)
    if not found:
        return Report([], [])
    return Report(
        [*sensitivity.write(found, place), *sensitivity_figure(found, place)], sensitivity.words(found)
    )


def _book(
    config: DictConfig,
    frame: pd.DataFrame,
    artifacts: Sequence[Path],
    sweep_dir: Path,
    run_dirs: Sequence[Path],
) -> None:
    """The sweep's run holds what its jobs have in common, and every row's figures by the row's name."""
    launches = [record for record in map(rundirs.read_launch, run_dirs) if record is not None]
    tracking = build_target(config.tracking, "tracking")
    shared = rundirs.common([record.configs[0] for record in launches])
    tracking.start(shared, sweep_dir, {"command": "sweep"})
    rows = [row for row in summarise(frame, systems={}) if row.episodes]
    tracking.finish(
        {f"{_name(row)}/{key}": value for row in rows for key, value in numbers(row).items()}, artifacts
    )


def _name(row: Row) -> str:
    parts = [
        row.label.removesuffix(" (ours)"),
        *(f"{key} {value}" for key, value in row.keys.items() if value),
    ]
    return _NO_METRIC_NAME.sub("_", " ".join(parts))
