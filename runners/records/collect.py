"""Collect the records of all runs below given folders."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lme.errors import InputError
from runners.records.launch_record import LAUNCH
from runners.records.records import has_records, read_episodes

if TYPE_CHECKING:
    import pandas as pd


# Errors from files of a run that somebody has changed: a part is missing, or has another type.
NOT_AS_WRITTEN = (
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    ArithmeticError,
    RecursionError,
)


class Collected(NamedTuple):
    """Collected runs. frames: records by run directory. problems: a line for each run that was left out."""

    frames: dict[Path, pd.DataFrame]
    problems: list[str]


def collect(folders: Iterable[Path]) -> Collected:
    """Return the records of every run in or below the folders, finished or not.

    Below a folder, only a directory with a launch record is a run: MLflow keeps copies of records without one.
    Raises InputError for a folder that does not exist or has no run below it.
    """
    collected = Collected({}, [])
    for folder in folders:
        runs = _runs_below(folder)
        if not runs:
            problem = "no run below it" if folder.is_dir() else "no such directory"
            raise InputError(f"{folder}: {problem}; run lme eval first, or give folders that hold runs")
        for run_dir in runs:
            _add(run_dir, collected)
    return collected


def _runs_below(folder: Path) -> list[Path]:
    run_dirs = sorted(path.parent for path in folder.rglob(LAUNCH))
    return [run for run in dict.fromkeys([folder, *run_dirs]) if has_records(run)]


def _add(run_dir: Path, collected: Collected) -> None:
    """Read a run, only once if several paths lead to it."""
    if any(run_dir.samefile(collected_dir) for collected_dir in collected.frames):
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about a run without episodes: the error says so
            collected.frames[run_dir] = read_episodes([run_dir])
    except (InputError, OSError) as error:
        collected.problems.append(str(error))
    except NOT_AS_WRITTEN as error:
        collected.problems.append(not_as_written(run_dir, error))


def not_as_written(run_dir: Path, error: Exception) -> str:
    """Return the message about a run whose files hold what lme does not write."""
    return f"{run_dir}: cannot be read ({type(error).__name__}: {str(error).partition(chr(10))[0]:.200})"
