"""The two Parquet files of a run, `episodes.parquet` and `trajectories.parquet`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError
from runners.records.append_log import LogEntry
from runners.records.episode_record import COLUMNS, KEY_COLUMNS, TEXTS, EpisodeKey
from runners.records.whole_file import replacing

if TYPE_CHECKING:
    import pyarrow as pa

EPISODES = "episodes.parquet"
TRAJECTORIES = "trajectories.parquet"


def keys_of(run_dir: Path) -> set[EpisodeKey]:
    """Keys of the episodes in the Parquet file of a run."""
    path = run_dir / EPISODES
    return _keys(_read_table(path)) if path.is_file() else set()


def episode_table(run_dir: Path, entries: Sequence[LogEntry]) -> pa.Table:
    """Episodes of the run's Parquet file and of its append log, sorted by key, each once."""
    import pyarrow as pa

    path = run_dir / EPISODES
    rows = _read_table(path).to_pylist() if path.is_file() else []
    by_key = {EpisodeKey.of(row): row for row in [*(entry.row for entry in entries), *rows]}
    ordered = [by_key[key] for key in sorted(by_key)]
    names = _in_order({name for row in ordered for name in row}, COLUMNS)
    try:
        return pa.table({name: [row.get(name) for row in ordered] for name in names})
    except pa.ArrowException as error:
        raise _disagree(run_dir, error) from None


def trajectory_table(run_dir: Path, entries: Sequence[LogEntry]) -> pa.Table:
    """Control steps in the run's Parquet file and of its append log, sorted; those of each episode once."""
    import pyarrow as pa

    from lme.episode import TRAJECTORY_COLUMNS

    known = (*KEY_COLUMNS, "step", *TRAJECTORY_COLUMNS)
    path = run_dir / TRAJECTORIES
    tables = [_read_table(path, (*KEY_COLUMNS, "step"))] if path.is_file() else []
    done = {key for table in tables for key in _keys(table)}
    tables += [_steps(entry) for entry in entries if entry.key not in done]
    if not tables:
        return pa.table({name: [] for name in known})
    try:
        joined = pa.concat_tables(tables, promote_options="default")
    except pa.ArrowException as error:
        raise _disagree(run_dir, error) from None
    joined = joined.select(_in_order(set(joined.column_names), known))
    return joined.sort_by([(name, "ascending") for name in (*KEY_COLUMNS, "step")]).combine_chunks()


def write_table(table: pa.Table, path: Path) -> None:
    """Write a Parquet file whole. Raises OSError."""
    import pyarrow.parquet as pq

    # Through a Python file, because its OSError has the number that tells a full disk from other causes.
    with replacing(path) as draft, draft.open("wb") as file:
        pq.write_table(table, file)


def _read_table(path: Path, required: Sequence[str] = KEY_COLUMNS) -> pa.Table:
    """A Parquet file of records. Raises InputError where it is none."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        # read_table would take the name of the folder for a partition key; ParquetFile does not.
        with pq.ParquetFile(path) as file:
            table = file.read()
        table.validate(full=True)  # texts are not decoded before they are used
        names = table.column_names
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} is not a readable Parquet file: {reason}; restore or remove it") from None
    missing = set(required) - set(names)
    if missing:
        raise InputError(f"{path} lacks the columns {', '.join(sorted(missing))}: not a file of lme eval")
    _check_columns(table, path)
    return table


def _check_columns(table: pa.Table, path: Path) -> None:
    """Raise InputError for a column that stands twice, or whose values are not of its kind."""
    names = table.column_names
    for name, column in zip(names, table.columns, strict=True):
        if names.count(name) > 1:
            raise InputError(f"{path}: column {name!r} stands twice: not a file of lme eval")
        kinds = _kinds(column.type)
        if name in KEY_COLUMNS:
            right = "int" in kinds and not column.null_count
        elif name in COLUMNS:
            right = ("text" if name in TEXTS else "number") in kinds or column.null_count == len(column)
        else:
            right = bool(kinds)
        if not right:
            raise InputError(f"{path}: column {name!r} holds {column.type}: not a file of lme eval")


def _kinds(held: pa.DataType) -> set[str]:
    """What a column of this type holds; empty for what no column of records does."""
    import pyarrow.types as types

    held = held.value_type if types.is_dictionary(held) else held
    found = {
        "int": types.is_integer(held),
        "number": types.is_integer(held) or types.is_floating(held),
        "text": types.is_string(held) or types.is_large_string(held),
        "other": types.is_null(held) or types.is_boolean(held),
    }
    return {kind for kind, holds in found.items() if holds}


def _keys(table: pa.Table) -> set[EpisodeKey]:
    distinct = table.group_by(list(KEY_COLUMNS)).aggregate([])
    return {EpisodeKey.of(row) for row in distinct.to_pylist()}


def _disagree(run_dir: Path, error: Exception) -> InputError:
    """The error for records that are each right, but hold different things under the same name."""
    reason = str(error).splitlines()[0]
    return InputError(f"records in {run_dir} disagree: {reason}; remove the line or file that differs")


def _steps(entry: LogEntry) -> pa.Table:
    import pyarrow as pa

    num_steps = max(map(len, entry.trajectory.values()), default=0)
    world, run = (np.full(num_steps, number) for number in (entry.key.world, entry.key.run))
    return pa.table({"world": world, "run": run, "step": np.arange(num_steps), **entry.trajectory})


def _in_order(names: set[str], known: Sequence[str]) -> list[str]:
    """Known columns in their order, then the others by name."""
    return [name for name in known if name in names] + sorted(names - set(known))
