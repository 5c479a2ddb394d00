"""Control steps of episodes: as recorded, or driven again if the run did not keep them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError
from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.records.episode_record import EpisodeKey, EpisodeResult, RunLabels
from runners.records.launch_record import LAUNCH, read_launch
from runners.records.parquet import TRAJECTORIES, trajectory_table
from runners.records.records import log_of
from runners.workers.episodes import EpisodePayload, initialise
from runners.workers.executor import Map, ProcessConfig, ProcessExecutor
from runners.workers.trace import another_path, check_repeatable, ends_alike

if TYPE_CHECKING:
    import pyarrow as pa

_BLOCK = 1000  # episodes that are held in memory at once


def step_tables(run_dir: Path, rows: Mapping[EpisodeKey, Mapping[str, Any]]) -> Iterator[pa.Table]:
    """Yield the steps of these episodes in the order of their keys, with the columns of `trajectories.parquet`.

    rows: the record of each episode. Raises InputError if episodes without steps cannot be driven again, or then
    differ from their records.
    """
    import pyarrow as pa

    keys = sorted(rows)
    with log_of(run_dir) as log, contextlib.ExitStack() as workers:
        drive: Map | None = None
        for start in range(0, len(keys), _BLOCK):
            block = keys[start : start + _BLOCK]
            table = trajectory_table(run_dir, log, block)
            stored_keys = set(map(EpisodeKey, table["world"].to_pylist(), table["run"].to_pylist()))
            missing_keys = [key for key in block if key not in stored_keys]
            # Drive only the episodes whose steps were not kept; workers start when the first is needed.
            if missing_keys:
                drive = drive or workers.enter_context(_driver(run_dir, rows))
                rerun_tables = [
                    _table(_check_repeated(result, rows, run_dir)) for result in drive(missing_keys)
                ]
                joined = pa.concat_tables([table, *rerun_tables], promote_options="permissive")
                table = joined.sort_by([(name, "ascending") for name in ("world", "run", "step")])
            yield table


@contextlib.contextmanager
def _driver(run_dir: Path, rows: Mapping[EpisodeKey, Mapping[str, Any]]) -> Iterator[Map]:
    """Give a `map` that drives these episodes of a run, in processes. rows: their records, with the same labels."""
    launch = read_launch(run_dir)
    if launch is None:
        raise InputError(
            f"{run_dir}: has no {TRAJECTORIES} with all steps, and no {LAUNCH} to drive its episodes again"
        )
    key, row = next(iter(rows.items()))
    check_repeatable(launch, run_dir, key)
    labels = RunLabels(**{field.name: str(row.get(field.name, "")) for field in fields(RunLabels)})
    # Take the worlds from the records: lme figure also drives worlds that its config does not choose.
    worlds = sorted({key.world for key in rows})
    config = replace(launch.config, map={**launch.config.map, "worlds": worlds})
    payload = EpisodePayload(config, labels, None)
    with ProcessExecutor(ProcessConfig(workers=None)).open(initialise, payload) as run_all:
        yield run_all


def _check_repeated(
    result: EpisodeResult, rows: Mapping[EpisodeKey, Mapping[str, Any]], run_dir: Path
) -> EpisodeResult:
    """Return the result. Raises InputError unless the drive equals its record."""
    record = result.record
    if not ends_alike(
        rows[record.key], record.outcome, record.steps, record.path_length_m, record.final_distance_m
    ):
        raise another_path(run_dir, record.key)
    return result


def _table(result: EpisodeResult) -> pa.Table:
    import pyarrow as pa

    count = len(result.trajectory)
    columns: Sequence[np.ndarray[Any, Any]] = list(result.trajectory.T)
    return pa.table(
        {
            "world": np.full(count, result.record.world),
            "run": np.full(count, result.record.run),
            "step": np.arange(count),
            **dict(zip(TRAJECTORY_COLUMNS, columns, strict=True)),
        }
    )
