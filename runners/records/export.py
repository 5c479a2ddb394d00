"""Export records as files for other programs: CSV, JSON lines, or Parquet with some of the columns."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from lme.errors import InputError, nearest
from runners.config.escaping import csv_value, json_text
from runners.records.records import episode_tables

if TYPE_CHECKING:
    import pyarrow as pa

_RUN_COLUMNS = (
    "run_dir",
    "sim",
    "filter",
    "crowd",
    "scale",
)  # tell runs apart, as do changed keys, which have a dot

Write = Callable[
    [Iterable["pa.Table"], Any], int
]  # takes tables and an open file, returns the number of rows


def episodes(run_dirs: Sequence[Path]) -> Iterator[pa.Table]:
    """Yield the records of a run as its file holds them; for several runs, with the columns that tell them apart."""
    tables = episode_tables(run_dirs)
    if len(tables) == 1:
        yield tables[0][0]
        return
    names = dict.fromkeys(name for table, _ in tables for name in table.column_names)
    run_columns = dict.fromkeys(
        key for _, columns in tables for key in columns if key in _RUN_COLUMNS or "." in key
    )
    for table, columns in tables:
        full_table = _with_columns(table, {name: None for name in names if name not in table.column_names})
        full_table = _with_columns(
            full_table.select(list(names)), {key: columns.get(key, "") for key in run_columns}
        )
        yield full_table.select(["run_dir", *names, *(key for key in run_columns if key != "run_dir")])


def with_run_dir(tables: Iterable[pa.Table], run_dir: Path) -> Iterator[pa.Table]:
    """Yield the tables with the column `run_dir` before the others."""
    for table in tables:
        yield _with_columns(table, {"run_dir": str(run_dir)}).select(["run_dir", *table.column_names])


def select(tables: Iterable[pa.Table], columns: Sequence[str]) -> Iterator[pa.Table]:
    """Yield the tables with these columns in this order, or with all columns if none are named.

    Raises InputError for a column that does not exist or is named twice, and for tables whose columns differ from
    those of the first.
    """
    names: list[str] = []
    for table in tables:
        names = names or _check_columns(columns, table.column_names) or table.column_names
        lacking_columns = [name for name in names if name not in table.column_names]
        if lacking_columns or (not columns and len(names) < table.num_columns):
            raise InputError(
                "the runs have different columns, perhaps because different versions of lme recorded them: export "
                "each alone, or choose --columns that all have"
            )
        yield table.select(names)


def write_csv(tables: Iterable[pa.Table], file: IO[str]) -> int:
    """Write a header and the rows; return their number. Floats are exact. Missing values and NaN are empty.

    Text that a spreadsheet would take for a formula begins with an apostrophe.
    """
    writer = csv.writer(file, lineterminator="\n")
    count = 0
    for number, table in enumerate(tables):
        if number == 0:
            writer.writerow(map(csv_value, table.column_names))
        writer.writerows(_rows(table, _csv_value))  # csv writes floats as repr() does
        count += table.num_rows
    return count


def write_jsonl(tables: Iterable[pa.Table], file: IO[str]) -> int:
    """Write an object of JSON for each row; return their number. NaN and infinity, which JSON lacks, are null."""
    count = 0
    for table in tables:
        for row in _rows(table, _json_value):
            values_by_name = dict(zip(table.column_names, row, strict=True))
            file.write(json_text(json.dumps(values_by_name, ensure_ascii=False)) + "\n")
        count += table.num_rows
    return count


def write_parquet(tables: Iterable[pa.Table], file: IO[bytes]) -> int:
    """Write Parquet; return the number of rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    # A column that a run lacks has the type null there.
    full_table = pa.concat_tables(tables, promote_options="permissive")
    pq.write_table(full_table, file)
    return int(full_table.num_rows)


FORMATS: dict[str, Write] = {"csv": write_csv, "jsonl": write_jsonl, "parquet": write_parquet}
BINARY = ("parquet",)


def _check_columns(columns: Sequence[str], column_names: Sequence[str]) -> list[str]:
    for number, name in enumerate(columns):
        if name in columns[:number]:
            raise InputError(f"--columns {','.join(columns)}: names {name} twice; name each column once")
        if name not in column_names:
            raise InputError(
                f"--columns {name}: no such column; {nearest(name, column_names)}there are: {', '.join(column_names)}"
            )
    return list(columns)


def _with_columns(table: pa.Table, constants: Mapping[str, object]) -> pa.Table:
    import pyarrow as pa

    for name, value in constants.items():
        table = table.append_column(name, pa.array([value] * table.num_rows))
    return table


def _rows(table: pa.Table, value: Callable[[Any], Any]) -> Iterator[list[Any]]:
    for batch in table.to_batches(max_chunksize=10_000):
        columns = [column.to_pylist() for column in batch.columns]
        for row in zip(*columns, strict=True):
            yield [value(cell) for cell in row]


def _csv_value(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else csv_value(value)


def _json_value(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
