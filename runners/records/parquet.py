"""Parquet files of a run, `episodes.parquet` and `trajectories.parquet`, checked before they are read.

Control steps are read and written in blocks of whole episodes, so a run of any length needs little memory.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import groupby, islice, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.types import Ints
from runners.records.atomic_write import replacing
from runners.records.episode_record import (
    COLUMNS,
    KEY_COLUMNS,
    TEXTS,
    AppendLog,
    EpisodeKey,
    EpisodeKeys,
    LogEntry,
)

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq


STEP_KEY = (*KEY_COLUMNS, "step")
EPISODES = "episodes.parquet"
TRAJECTORIES = "trajectories.parquet"
_BLOCK_STEPS = 100_000  # control steps of a block, which is a row group of trajectories.parquet
_GROUP_ROWS = 100_000  # episodes of a row group of episodes.parquet, or more
_BATCH = 5_000  # episodes that are Python objects at a time, at most


def read_table(path: Path, is_wanted: Callable[[str], bool] = lambda name: True) -> pa.Table:
    """Read a Parquet file of records, or the wanted columns of it. Raises InputError if it is not one."""
    with _opened(path) as file:
        return _validated(file.read(list(filter(is_wanted, file.schema_arrow.names))), path)


def first_row(path: Path) -> dict[str, Any]:
    """Return the first row of a Parquet file of records, which must have one. Raises InputError if it is not one."""
    with _opened(path) as file:
        row: dict[str, Any] = _validated(next(file.iter_batches(batch_size=1)), path).to_pylist()[0]
    return row


def row_groups(path: Path, worlds: Ints | None = None) -> Iterator[pa.Table]:
    """Yield the row groups that are not empty; with sorted `worlds`, only those that may hold one of them."""
    with _opened(path, STEP_KEY) as file:
        for number in range(file.num_row_groups):
            if worlds is None or _may_hold(file, number, worlds):
                table = _validated(file.read_row_group(number), path)
                if table.num_rows:
                    yield table


def _may_hold(file: pq.ParquetFile, group: int, worlds: Ints) -> bool:
    column = file.schema_arrow.get_field_index("world")
    chunk = file.metadata.row_group(group).column(column)
    # If the two types differ, reading the statistics of the column would make Arrow abort the process.
    if chunk.physical_type != file.schema.column(column).physical_type:
        raise OSError(f"row group {group} holds world as {chunk.physical_type}")
    statistics = chunk.statistics
    if statistics is None or not statistics.has_min_max:
        return True
    return bool(((worlds >= statistics.min) & (worlds <= statistics.max)).any())


@contextlib.contextmanager
def _opened(path: Path, required: Sequence[str] = KEY_COLUMNS) -> Iterator[pq.ParquetFile]:
    """Open a Parquet file of records. Raises InputError if it is not one, also while it is being read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        # read_table would take the name of the folder for a partition key; ParquetFile does not.
        with pq.ParquetFile(path) as file:
            _check_columns(file.schema_arrow, required, path)
            yield file
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} is not a readable Parquet file: {reason}; restore or remove it") from None


def _check_columns(schema: pa.Schema, required: Sequence[str], path: Path) -> None:
    """Raise InputError for a column that is missing, occurs twice, or has values of the wrong type."""
    names = schema.names
    missing_columns = set(required) - set(names)
    if missing_columns:
        raise InputError(
            f"{path} lacks the columns {', '.join(sorted(missing_columns))}: not a file of lme eval"
        )
    for field in schema:
        if names.count(field.name) > 1:
            raise InputError(f"{path}: column {field.name!r} occurs twice: not a file of lme eval")
        if not _has_right_type(field):
            raise InputError(f"{path}: column {field.name!r} holds {field.type}: not a file of lme eval")


def _has_right_type(column: pa.Field) -> bool:
    """Return whether a column has one of its allowed types; pandas may have rewritten the file."""
    import pyarrow.types as types

    value_type = column.type.value_type if types.is_dictionary(column.type) else column.type
    if column.name in STEP_KEY:
        return bool(types.is_integer(value_type))
    number = types.is_integer(value_type) or types.is_floating(value_type)
    text = types.is_string(value_type) or types.is_large_string(value_type)
    if column.name in COLUMNS:
        return bool(types.is_null(value_type) or (text if column.name in TEXTS else number))
    return bool(types.is_null(value_type) or types.is_boolean(value_type) or number or text)


def _validated(table: pa.Table, path: Path) -> pa.Table:
    """Return the table after a check of its values, which Arrow would decode only when they are used."""
    table.validate(full=True)
    for name in (*KEY_COLUMNS, "outcome"):
        if name in table.column_names and table[name].null_count:
            raise InputError(f"{path} has rows without {name}: not a file of lme eval")
    return table


def keys_of(run_dir: Path) -> EpisodeKeys:
    """Return the keys of the episodes in the Parquet file of a run."""
    path = run_dir / EPISODES
    return EpisodeKeys(_codes(read_table(path, KEY_COLUMNS.__contains__)) if path.is_file() else ())


def lacks_steps(run_dir: Path) -> bool:
    """Return whether the file with the control steps was deleted."""
    return (run_dir / EPISODES).is_file() and not (run_dir / TRAJECTORIES).is_file()


def keys_not_in(log: AppendLog, stored: EpisodeKeys) -> EpisodeKeys:
    """Return the keys of the append log that are not `stored`."""
    return EpisodeKeys(np.setdiff1d(log.keys.codes, stored.codes, assume_unique=True))


def episode_table(run_dir: Path, log: AppendLog, without: Collection[str] = ()) -> pa.Table:
    """Return the episodes of the run's Parquet file and append log, each once, sorted by key.

    without: names of columns that are not needed.
    """
    import pyarrow as pa

    path = run_dir / EPISODES
    tables = [read_table(path, lambda name: name not in without)] if path.is_file() else []
    new_keys = keys_not_in(log, EpisodeKeys(_codes(tables[0]) if tables else ()))
    with _explain_conflicts(run_dir):
        schema = _row_schema(log, without)
        tables += [_rows(block, schema) for block in _blocks(log.entries(new_keys))]
        joined = pa.concat_tables(tables, promote_options="permissive") if tables else schema.empty_table()
    joined = joined.select(_in_order(set(joined.column_names), COLUMNS))
    if joined.num_rows and not (np.diff(_codes(joined)) > 0).all():  # a file is sorted, and sorting copies it
        joined = joined.sort_by([(name, "ascending") for name in KEY_COLUMNS])
    return joined


def trajectory_table(
    run_dir: Path, log: AppendLog, selected: Collection[EpisodeKey] | None = None
) -> pa.Table:
    """Return the control steps of the run's Parquet file and append log, sorted; each episode's only once.

    selected: the episodes; None for all.
    """
    import pyarrow as pa

    stored_keys = keys_of(run_dir)
    new_keys = keys_not_in(log, stored_keys)
    if selected is not None:
        codes = EpisodeKeys.of(selected).codes
        stored_keys, new_keys = (
            EpisodeKeys(np.intersect1d(keys.codes, codes)) for keys in (stored_keys, new_keys)
        )
    with _explain_conflicts(run_dir):
        schema = _step_schema(log)
        tables = [
            schema.empty_table(),
            *_steps_in_file(run_dir / TRAJECTORIES, stored_keys),
            *(_steps(block, schema) for block in _blocks(log.entries(new_keys))),
        ]
        joined = pa.concat_tables(tables, promote_options="permissive")
    return joined.sort_by([(name, "ascending") for name in STEP_KEY]).combine_chunks()


def write_files(run_dir: Path, log: AppendLog) -> None:
    """Write both files again, from the append log. Raises OSError."""
    import pyarrow as pa

    with _explain_conflicts(run_dir):
        row_schema, step_schema = _row_schema(log), _step_schema(log)
        # Trajectories are replaced first: an episode is complete once it is in episodes.parquet.
        with (
            _written(run_dir / EPISODES, row_schema) as episodes,
            _written(run_dir / TRAJECTORIES, step_schema) as trajectories,
        ):
            rows = []
            for block in _blocks(log.entries()):
                trajectories.write_table(_steps(block, step_schema))
                rows.append(_rows(block, row_schema))
                if sum(map(len, rows)) >= _GROUP_ROWS:
                    episodes.write_table(pa.concat_tables(rows).combine_chunks())
                    rows = []
            if rows:
                episodes.write_table(pa.concat_tables(rows).combine_chunks())
    # What reads the files next needs the memory.
    pa.default_memory_pool().release_unused()


@contextlib.contextmanager
def _written(path: Path, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Yield a writer of row groups; the file replaces the one at `path` when the block ends. Raises OSError."""
    import pyarrow.parquet as pq

    # Written through Python's files, whose OSError has the errno that tells a full disk from other causes.
    with replacing(path) as draft, draft.open("wb") as file, pq.ParquetWriter(file, schema) as writer:
        yield writer


def entries_in_files(run_dir: Path) -> Iterator[LogEntry]:
    """Yield the episodes in the two files, if there are any, as they were in the append log."""
    if not (run_dir / EPISODES).is_file():
        return
    table = read_table(run_dir / EPISODES)
    codes, first_rows = np.unique(_codes(table), return_index=True)
    has_steps = np.zeros(len(table), dtype=bool)
    # Take the rows of a few thousand episodes at a time, because as Python objects they need ten times the memory.
    episodes = _by_episode(run_dir / TRAJECTORIES)
    while batch := list(islice(episodes, _BATCH)):
        steps_of = dict(batch)
        rows_here = first_rows[np.isin(codes, EpisodeKeys.of(steps_of).codes)]
        has_steps[rows_here] = True
        for row in _known_values(table.take(rows_here)):
            yield LogEntry(row, _trajectory(steps_of[EpisodeKey.of(row)]))
    rows_without_steps = np.setdiff1d(first_rows, np.flatnonzero(has_steps))
    for start in range(0, len(rows_without_steps), _BATCH):
        for row in _known_values(table.take(rows_without_steps[start : start + _BATCH])):
            yield LogEntry(row, {})


def _known_values(table: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table, each without the columns that it lacks."""
    for row in table.to_pylist():
        yield {name: value for name, value in row.items() if value is not None}


def _blocks(entries: Iterable[LogEntry]) -> Iterator[list[LogEntry]]:
    """Yield lists of entries, each with about `_BLOCK_STEPS` control steps in total, or `_BATCH` entries."""
    block: list[LogEntry] = []
    steps = 0
    for entry in entries:
        block.append(entry)
        steps += entry.steps
        if steps >= _BLOCK_STEPS or len(block) == _BATCH:
            yield block
            block, steps = [], 0
    if block:
        yield block


def _rows(block: Sequence[LogEntry], schema: pa.Schema) -> pa.Table:
    """Return the rows of the entries, in their order."""
    import pyarrow as pa

    return pa.table({name: [entry.row.get(name) for entry in block] for name in schema.names}, schema)


def _row_schema(log: AppendLog, without: Collection[str] = ()) -> pa.Schema:
    """Return the schema of all rows of the log: known columns in their order, then the others by name."""
    import pyarrow as pa

    types = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_(), type(None): pa.null()}
    layouts = [
        pa.schema(
            [(name, types[kind]) for name, kind in layout if kind in types]
        )  # others are refused as read
        for layout in sorted(log.row_layouts, key=str)
    ]
    schema = pa.unify_schemas(layouts or [pa.schema([])], promote_options="permissive")
    return pa.schema([schema.field(name) for name in _in_order({*schema.names} - {*without}, COLUMNS)])


def _step_schema(log: AppendLog) -> pa.Schema:
    """Return the schema of all trajectory columns of the log or, if it is empty, of those that this version knows."""
    import pyarrow as pa

    from lme.navigation.episode import TRAJECTORY_COLUMNS

    key = [(name, pa.int64()) for name in STEP_KEY]
    layouts = [
        pa.schema([*key, *((name, pa.from_numpy_dtype(np.dtype(kind))) for name, kind in layout)])
        for layout in sorted(log.layouts)
    ]
    schema = pa.unify_schemas(
        layouts or [pa.schema([*key, *((name, pa.null()) for name in TRAJECTORY_COLUMNS)])],
        promote_options="permissive",
    )
    names = _in_order(set(schema.names), (*STEP_KEY, *TRAJECTORY_COLUMNS))
    return pa.schema([schema.field(name) for name in names])


def _steps(block: Sequence[LogEntry], schema: pa.Schema) -> pa.Table:
    """Return the control steps of the entries, in their order."""
    import pyarrow as pa

    tables = [schema.empty_table()]
    for names, same_layout in groupby(block, key=lambda entry: tuple(entry.trajectory)):
        entries = list(same_layout)
        counts = [entry.steps for entry in entries]
        keys = {name: np.repeat([entry.row[name] for entry in entries], counts) for name in KEY_COLUMNS}
        numbers = np.concatenate([np.arange(count) for count in counts])
        columns = {name: np.concatenate([entry.trajectory[name] for entry in entries]) for name in names}
        tables.append(pa.table({**keys, "step": numbers, **columns}))
    return pa.concat_tables(tables, promote_options="permissive").cast(schema).combine_chunks()


def _steps_in_file(path: Path, selected: EpisodeKeys) -> Iterator[pa.Table]:
    """Yield the control steps of the wanted episodes, by row group."""
    import pyarrow as pa

    if not path.is_file() or not selected:
        return
    for table in row_groups(path, np.unique(selected.codes >> 32)):
        yield table.filter(pa.array(np.isin(_codes(table), selected.codes)))


def _by_episode(path: Path) -> Iterator[tuple[EpisodeKey, pa.Table]]:
    """Yield the control steps of every episode in turn; a row group may end within an episode."""
    import pyarrow as pa

    remainder = None
    for group in row_groups(path) if path.is_file() else ():
        table = group if remainder is None else pa.concat_tables([remainder, group])
        codes = _codes(table)
        starts = np.flatnonzero(np.diff(codes, prepend=-1))
        for start, end in pairwise(starts.tolist()):
            yield EpisodeKey.of_code(int(codes[start])), table.slice(start, end - start)
        remainder = table.slice(int(starts[-1]))
    if remainder is not None:
        yield EpisodeKey.of_code(int(_codes(remainder)[0])), remainder


@contextlib.contextmanager
def _explain_conflicts(run_dir: Path) -> Iterator[None]:
    """Raise InputError if records are valid one by one, but hold different types under the same name."""
    import pyarrow as pa

    try:
        yield
    except pa.ArrowException as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"records in {run_dir} disagree: {reason}; remove the line or file that differs"
        ) from None


def _codes(table: pa.Table) -> Ints:
    """Return the code of each row's key, see `EpisodeKey.code`: (N,)."""
    worlds, runs = (table[name].to_numpy().astype(np.int64) for name in KEY_COLUMNS)
    codes: Ints = (worlds << 32) + runs
    return codes


def _trajectory(steps: pa.Table) -> dict[str, NDArray[Any]]:
    """Return the columns of an episode, without those that it lacks."""
    names = [name for name in steps.column_names if name not in STEP_KEY]
    return {name: steps[name].to_numpy() for name in names if steps[name].null_count < len(steps)}


def _in_order(names: set[str], known_order: Sequence[str]) -> list[str]:
    """Return known columns in their order, then the others by name."""
    return [name for name in known_order if name in names] + sorted(names - set(known_order))
