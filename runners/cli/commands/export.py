"""Write records, or the control steps of episodes, as CSV, JSON lines or Parquet."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from runners.cli.parsers import add_trust, texts

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
_FORMATS = ("csv", "jsonl", "parquet")
_EPISODE = re.compile(r"\d+(/\d+)?|failures")


def main(argv: list[str]) -> int:
    """Write the rows to the file or to standard output. Raises InputError."""
    from runners.records import export
    from runners.records.atomic_write import is_standard_output
    from runners.records.records import find_runs

    arguments = _parsed(argv)
    style = _format(arguments.format, arguments.output)
    runs = find_runs(arguments.runs)
    tables = export.episodes(runs) if arguments.steps is None else _steps(runs, arguments.steps)
    column_names = [name for name in (arguments.columns or "").split(",") if name]
    rows = export.select(tables, column_names)
    if arguments.output is None or str(arguments.output) == "-":
        export.FORMATS[style](rows, sys.stdout)
    else:
        count = _to_file(rows, arguments.output, style)
        stream = sys.stderr if is_standard_output(arguments.output) else sys.stdout
        print(f"{count} rows: {arguments.output}", file=stream)
    return 0


def _parser() -> argparse.ArgumentParser:
    notes = (
        "Columns are those of episodes.parquet, or with --steps of trajectories.parquet; units are in their names\n"
        "(docs/records.md). Several runs, or a sweep, go into one file, with the column run_dir before the others,\n"
        "and with a column for every key that differs. CSV holds every digit; an empty field is a missing value.\n"
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
    parser.add_argument("--format", choices=_FORMATS, help="default: by the ending of --output, else csv")
    parser.add_argument(
        "--output", "-o", type=Path, metavar="FILE", help="default: -, which is standard output"
    )
    add_trust(parser)
    return parser


def _parsed(argv: list[str]) -> argparse.Namespace:
    """Parse the arguments. All words after --steps belong to it, except paths of runs, which become positional again.

    Raises InputError without a run.
    """
    from lme.errors import InputError

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
    from lme.errors import InputError

    formats = ", ".join(_FORMATS)
    ending = "" if output is None else output.suffix.lower().removeprefix(".")
    if ending and ending not in _FORMATS and not format_name:
        raise InputError(
            f"--output {output}: .{ending} is not a format; end it in one of {formats}, or add --format"
        )
    if format_name and ending in _FORMATS and ending != format_name:
        raise InputError(f"--output {output} --format {format_name}: ask for two formats; give one of them")
    style = format_name or ending or "csv"
    if style == "parquet" and (output is None or str(output) == "-"):
        raise InputError("--format parquet: is not text, so it needs --output FILE")
    return style


def _steps(runs: Sequence[Path], words: Sequence[str]) -> Iterator[pa.Table]:
    """Return the steps of the named episodes of each run. Raises InputError before anything is written."""
    from lme.errors import InputError
    from runners.records.export import with_run_dir
    from runners.records.records import read_episodes
    from runners.reports.explainer.pages import keys_of
    from runners.workers.steps import step_tables

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
    from lme.errors import InputError
    from runners.records import export
    from runners.records.atomic_write import output_file

    try:
        with output_file(path) as draft:
            if style in export.BINARY:
                with draft.open("wb") as binary:
                    return export.FORMATS[style](rows, binary)
            with draft.open("w", encoding="utf-8", newline="") as file:
                return export.FORMATS[style](rows, file)
    except BrokenPipeError:  # its reader has seen enough
        raise
    except OSError as error:
        raise InputError(f"--output {path}: cannot be written ({error.strerror})") from error
