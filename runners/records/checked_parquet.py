"""Reads Parquet files of records, and checks their columns, the types of the values, and that no key is missing."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lme.errors import InputError
from lme.types import Ints
from runners.records.episode_record import COLUMNS, KEY_COLUMNS, TEXTS

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

STEP_KEY = (*KEY_COLUMNS, "step")


def read_table(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """A Parquet file of records, or these columns of it. Raises InputError if it is not one."""
    with _opened(path) as file:
        return _validated(file.read(columns), path)


def row_groups(path: Path, worlds: Ints | None = None) -> Iterator[pa.Table]:
    """The row groups that are not empty; only those that may hold one of the sorted `worlds`."""
    with _opened(path, STEP_KEY) as file:
        for number in range(file.num_row_groups):
            if worlds is None or _may_hold(file, number, worlds):
                table = _validated(file.read_row_group(number), path)
                if table.num_rows:
                    yield table


def _may_hold(file: pq.ParquetFile, group: int, worlds: Ints) -> bool:
    column = file.schema_arrow.get_field_index("world")
    chunk = file.metadata.row_group(group).column(column)
    # Arrow would abort the process on reading the statistics of such a column.
    if chunk.physical_type != file.schema.column(column).physical_type:
        raise OSError(f"row group {group} holds world as {chunk.physical_type}")
    found = chunk.statistics
    if found is None or not found.has_min_max:
        return True
    return bool(((worlds >= found.min) & (worlds <= found.max)).any())


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
    missing = set(required) - set(names)
    if missing:
        raise InputError(f"{path} lacks the columns {', '.join(sorted(missing))}: not a file of lme eval")
    for field in schema:
        if names.count(field.name) > 1:
            raise InputError(f"{path}: column {field.name!r} occurs twice: not a file of lme eval")
        if not _has_right_type(field):
            raise InputError(f"{path}: column {field.name!r} holds {field.type}: not a file of lme eval")


def _has_right_type(column: pa.Field) -> bool:
    """Whether a column has one of the types that it may have; pandas may have rewritten the file."""
    import pyarrow.types as types

    held = column.type.value_type if types.is_dictionary(column.type) else column.type
    if column.name in STEP_KEY:
        return bool(types.is_integer(held))
    number = types.is_integer(held) or types.is_floating(held)
    text = types.is_string(held) or types.is_large_string(held)
    if column.name in COLUMNS:
        return bool(types.is_null(held) or (text if column.name in TEXTS else number))
    return bool(types.is_null(held) or types.is_boolean(held) or number or text)


def _validated(table: pa.Table, path: Path) -> pa.Table:
    """The table, after a check of its values, which Arrow would not decode before they are used."""
    table.validate(full=True)
    for name in (*KEY_COLUMNS, "outcome"):
        if name in table.column_names and table[name].null_count:
            raise InputError(f"{path} has rows without {name}: not a file of lme eval")
    return table
