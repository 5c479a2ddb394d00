"""Results of a sweep: one table, one chart, and one tracked run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from runners.config import instantiate
from runners.config.ablations import labels
from runners.config.changes import describe_changes
from runners.config.job import Job
from runners.config.schema import ReportConfig
from runners.config.systems import systems
from runners.records import launch_record
from runners.records.records import find_runs, read_episodes
from runners.reports.analysis.summary import Row, numbers, summarise
from runners.tracking.mlflow import closed_by
from runners.tracking.names import LABELS, fitting_names, parameters

if TYPE_CHECKING:
    import pandas as pd


class Report(NamedTuple):
    """Files that were written, and the lines to print below the table."""

    files: list[Path]
    lines: list[str]


def finish(job: Job[ReportConfig], run_dirs: Sequence[Path]) -> None:
    """Tabulate, draw, print and track all runs of a sweep. job: the first one."""
    from runners.reports.analysis.tables import print_table

    run_dirs = find_runs(run_dirs)
    frame = read_episodes(run_dirs)
    sweep_dir = job.sweep_dir
    assert sweep_dir is not None
    rows = summarise(frame, job.config.table, systems(job.folders), labels(job.folders))
    artifacts, lines = report(frame, rows, run_dirs, sweep_dir)
    print_table(frame, rows)
    for line in lines:
        print(line)
    print(f"The sweep's table and pictures: {sweep_dir}")
    _track(job.config, frame, artifacts, sweep_dir, run_dirs)


def report(frame: pd.DataFrame, rows: Sequence[Row], run_dirs: Sequence[Path], folder: Path) -> Report:
    """Write the table and pictures of several runs into `folder`, and the studies that the records allow.

    frame: their records. rows: those of their table.
    """
    from runners.reports.analysis.comparison import comparison_figure
    from runners.reports.analysis.tables import write_tables
    from runners.reports.figures.trajectories import side_by_side_figure

    files = [
        *write_tables(frame, rows, folder),
        *comparison_figure(frame, rows, folder),
        *side_by_side_figure(frame, run_dirs, folder),
    ]
    studied = _studies(frame, folder)
    return Report(files + studied.files, studied.lines)


def _studies(frame: pd.DataFrame, folder: Path) -> Report:
    """Write the studies of systems, ablations, scales and values of a key, if the records have any."""
    from runners.reports.analysis import study
    from runners.reports.analysis.ablation import AblationStudy
    from runners.reports.analysis.comparison import Comparison
    from runners.reports.analysis.curves import CurveStudy
    from runners.reports.analysis.sensitivity import SensitivityStudy

    kinds: tuple[type[study.SweepStudy], ...] = (Comparison, AblationStudy, SensitivityStudy, CurveStudy)
    files: list[Path] = []
    lines: list[str] = []
    for kind in kinds:
        studies = kind.studies(frame)
        if studies:
            files += study.write(studies, folder)
            lines += [line for sweep_study in studies for line in sweep_study.sentences()]
    return Report(files, lines)


def _track(
    config: ReportConfig,
    frame: pd.DataFrame,
    artifacts: Sequence[Path],
    sweep_dir: Path,
    run_dirs: Sequence[Path],
) -> None:
    """Track the sweep: the config that its jobs share, and the metrics of every row by its name."""
    launches = [record for record in map(launch_record.read_launch, run_dirs) if record is not None]
    tracking = instantiate.build(config.tracking, "tracking")
    shared = launch_record.common([record.configs[0] for record in launches])
    changes = launch_record.common([record.changes[0] for record in launches])
    shared |= {key: frame[key].iloc[0] for key in LABELS if frame[key].nunique() == 1}
    tracking.start(parameters(shared), sweep_dir, {"command": "sweep", "changes": describe_changes(changes)})
    with closed_by(tracking):
        rows = [row for row in summarise(frame, systems={}) if row.episodes]
        names = fitting_names([_name(row) for row in rows])
        metrics = zip(names, map(numbers, rows), strict=True)
        tracking.finish(
            {f"{name}/{key}": value for name, values in metrics for key, value in values.items()}, artifacts
        )


def _name(row: Row) -> str:
    words = [
        row.label.removesuffix(" (ours)"),
        *(f"{key} {value}" for key, value in row.keys.items() if value),
    ]
    return " ".join(words)
