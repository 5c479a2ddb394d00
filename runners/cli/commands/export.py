"""Write records, or the control steps of episodes, as CSV, JSON lines or Parquet."""

from __future__ import annotations

import argparse
import csv
import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from lme.errors import InputError, nearest
from runners.cli.help import add_trust, texts
from runners.config.escaping import counted, csv_value, json_text

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from runners.records.episode_record import EpisodeKey

EXAMPLES = (
    "lme export outputs/eval/RUN > episodes.csv",
    "lme export outputs/eval/RUN --columns world,run,outcome,time_s",
    "lme export outputs/eval/RUN --steps 282/1 --output steps.csv",
    "lme export outputs/eval/RUN --steps failures --format jsonl",
    "lme export outputs/eval/SWEEP --output sweep.parquet",
)
_EPISODE = re.compile(r"\d+(/\d+)?|failures")
_RUN_COLUMNS = (
    "run_dir",
    "sim",
    "filter",
    "crowd",
    "scale",
)  # tell runs apart, as do changed keys
Write = Callable[
    [Iterable["pa.Table"], Any], int
]  # takes tables and an open file, returns the number of rows


def main(argv: list[str]) -> int:
    """Write the rows to the file or to standard output. Raises InputError."""
    from runners.records.atomic_write import is_standard_output
    from runners.records.records import find_runs

    arguments = _parsed(argv)
    style = _format(arguments.format, arguments.output)
    runs = find_runs(arguments.runs)
    _check_no_record(arguments.output, runs)
    tables = episodes(runs) if arguments.steps is None else _steps(runs, arguments.steps)
    column_names = [name for name in (arguments.columns or "").split(",") if name]
    rows = select(tables, column_names)
    if arguments.output is None or str(arguments.output) == "-":
        FORMATS[style](rows, sys.stdout)
    else:
        count = _to_file(rows, arguments.output, style)
        stream = sys.stderr if is_standard_output(arguments.output) else sys.stdout
        print(f"{counted(count, 'row')}: {arguments.output}", file=stream)
    return 0


def _parser() -> argparse.ArgumentParser:
    notes = (
        "Columns are those of episodes.parquet, or with --steps of trajectories.parquet; units are in their names\n"
        "(docs/reference/records.md). Several runs, or a sweep, go into one file, with the column run_dir before the\n"
        "others, and with a column for every key that differs. CSV holds every digit; an empty field is a missing\n"
        "value. "
        "A run without trajectories.parquet has its episodes driven once more, and they must repeat what was recorded."
    )
    parser = argparse.ArgumentParser(prog="lme export", **texts(__doc__, EXAMPLES, notes))
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN", help="a run's directory, or a sweep's")
    parser.add_argument(
        "--steps",
        nargs="*",
        metavar="EPISODE",
        help="the control steps of WORLD (its run 0), WORLD/RUN or failures; none: of all episodes",
    )
    parser.add_argument("--columns", metavar="A,B,…", help="these columns, in this order")
    parser.add_argument(
        "--format", choices=tuple(FORMATS), help="default: by the ending of --output, else csv"
    )
    parser.add_argument(
        "--output", "-o", type=Path, metavar="FILE", help="default: -, which is standard output"
    )
    add_trust(parser)
    return parser


def _parsed(argv: list[str]) -> argparse.Namespace:
    """Parse the arguments. All words after --steps belong to it, except paths of runs, which become positional again.

    Raises InputError without a run.
    """
    arguments = _parser().parse_args(argv)
    runs = [word for word in arguments.steps or [] if not _EPISODE.fullmatch(word) and Path(word).is_dir()]
    arguments.runs += map(Path, runs)
    if runs:
        arguments.steps = [word for word in arguments.steps if word not in runs]
    if not arguments.runs:
        raise InputError("RUN is missing: give the directory of a run or of a sweep, before --steps")
    return arguments


def _format(format_name: str | None, output: Path | None) -> str:
    """Return the format. Raises InputError for Parquet without a file, and for a file with another suffix."""
    formats = ", ".join(FORMATS)
    ending = "" if output is None else output.suffix.lower().removeprefix(".")
    if ending and ending not in FORMATS and not format_name:
        raise InputError(
            f"--output {output}: .{ending} is not a format; end it in one of {formats}, or add --format"
        )
    if format_name and ending in FORMATS and ending != format_name:
        raise InputError(f"--output {output} --format {format_name}: ask for two formats; give one of them")
    style = format_name or ending or "csv"
    if style == "parquet" and (output is None or str(output) == "-"):
        raise InputError("--format parquet: is not text, so it needs --output FILE")
    return style


def _check_no_record(output: Path | None, runs: Sequence[Path]) -> None:
    """Raise InputError if the output would replace a file that these runs, or another one, consist of."""
    from runners.records.episode_record import APPEND_LOG
    from runners.records.launch_record import LAUNCH
    from runners.records.parquet import EPISODES, TRAJECTORIES

    if output is None:
        return
    file = output.resolve()
    folders = [folder for folder in (file.parent, file.parent.parent) if (folder / LAUNCH).is_file()]
    if file in {
        run.resolve() / name
        for run in (*runs, *folders)
        for name in (EPISODES, TRAJECTORIES, APPEND_LOG, LAUNCH)
    }:
        raise InputError(f"--output {output}: is a file of a run: choose another one")


def _steps(runs: Sequence[Path], words: Sequence[str]) -> Iterator[pa.Table]:
    """Return the steps of the named episodes of each run. Raises InputError before anything is written."""
    from runners.records.records import read_episodes
    from runners.reports.explainer.pages import keys_of
    from runners.workers.trace import step_tables

    tables_of_runs = []
    for run_dir in runs:
        frame = read_episodes([run_dir])
        records = dict(zip(keys_of(frame), frame.to_dict("records"), strict=True))
        selected_records = {key: records[key] for key in _keys(frame, words)}
        if selected_records:
            tables = step_tables(run_dir, selected_records)
            tables_of_runs.append(with_run_dir(tables, run_dir) if len(runs) > 1 else tables)
    if not tables_of_runs:
        raise InputError(f"--steps {' '.join(words)}: no episode failed")
    return chain.from_iterable(tables_of_runs)


def _keys(frame: pd.DataFrame, words: Sequence[str]) -> list[EpisodeKey]:
    from runners.reports.analysis.failures import is_failure
    from runners.reports.explainer.pages import keys_of, select_episodes

    if not words:
        return keys_of(frame)
    if list(words) == ["failures"]:
        return keys_of(frame[is_failure(frame)])
    return keys_of(select_episodes(frame, words))


def _to_file(rows: Iterator[pa.Table], path: Path, style: str) -> int:
    """Write a whole file and return the number of its rows. Raises InputError where it cannot be written."""
    from runners.records.atomic_write import output_file

    try:
        with output_file(path) as draft:
            is_binary = style == "parquet"
            with draft.open("wb") if is_binary else draft.open("w", encoding="utf-8", newline="") as file:
                return FORMATS[style](rows, file)
    except BrokenPipeError:  # its reader has seen enough
        raise
    except OSError as error:
        raise InputError(f"--output {path}: cannot be written ({error.strerror})") from error


def episodes(run_dirs: Sequence[Path]) -> Iterator[pa.Table]:
    """Yield the records of a run as its file holds them; for several runs, with the columns that tell them apart."""
    from runners.config.changes import is_config_key
    from runners.records.records import episode_tables

    tables = episode_tables(run_dirs)
    if len(tables) == 1:
        yield tables[0][0]
        return
    names = dict.fromkeys(name for table, _ in tables for name in table.column_names)
    run_columns = dict.fromkeys(
        key for _, columns in tables for key in columns if key in _RUN_COLUMNS or is_config_key(key)
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
