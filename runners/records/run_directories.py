"""Directories of runs: the one that a run writes to, the one that `resume=` continues, and all below given folders."""

from __future__ import annotations

import contextlib
import sys
import warnings
from collections.abc import Iterable, Iterator
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from lme.errors import InputError
from runners.config.quoting import lme_command, resume_command
from runners.records import inputs
from runners.records.episode_record import APPEND_LOG, lock
from runners.records.launch_record import (
    LAUNCH,
    Launch,
    differences,
    directory_error,
    job_folders,
    read_launch,
    shortened,
)
from runners.records.records import has_records, read_episodes

if TYPE_CHECKING:
    import pandas as pd

ROOT = Path("outputs")
_RESULTS = ("episodes.parquet", "study.journal", "checkpoint.pt")
_ADVICE = "resume it with resume=PATH alone, or choose another directory"
_OUTDATED = "the options that it was started with have changed since"
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


def resumable(launch: Launch) -> Path:
    """Return the newest directory with the launch's fingerprint. Raises InputError if there is none."""
    pattern = f"*-{_fingerprint_suffix(launch)}*"
    folder = ROOT / launch.command
    # Equal dates and times are told apart by a number: …-2 is older than …-10.
    for directory in sorted(
        folder.glob(pattern), key=lambda path: (path.name[:19], len(path.name), path.name), reverse=True
    ):
        saved = read_launch(directory)
        if saved is not None and saved.fingerprint == launch.fingerprint:
            return directory
    raise InputError(
        f"resume=true: no run with this config, {folder / pattern} does not exist: "
        "omit resume to start one, or name the directory with resume=PATH"
    )


def check_same(launch: Launch, directory: Path) -> None:
    """Raise InputError, naming the first keys that differ, unless `directory` was started with this config."""
    saved = read_launch(directory)
    if saved is None:
        raise InputError(
            f"{directory}: has no {LAUNCH}, so there is no run to resume; choose another directory"
        )
    if saved.fingerprint == launch.fingerprint and saved.configs == launch.configs:
        inputs.check_unchanged(saved.inputs, launch.inputs, directory)
        return
    if _command_line(saved) == _command_line(launch):
        raise _outdated(saved, launch, directory)
    if (saved.command, len(saved.configs)) != (launch.command, len(launch.configs)):
        raise InputError(
            f"{directory}: holds {saved.command} with {len(saved.configs)} jobs, "
            f"not {launch.command} with {len(launch.configs)}: cannot be resumed as that"
        )
    if saved.multirun != launch.multirun:
        saved_kind, current_kind = ("a sweep", "one run") if saved.multirun else ("one run", "a sweep")
        raise InputError(f"{directory}: holds {saved_kind}, not {current_kind}: {_ADVICE}")
    raise InputError(f"{directory}: holds a run with another config ({_changes(saved, launch)}): {_ADVICE}")


def _outdated(saved: Launch, launch: Launch, directory: Path) -> InputError:
    """Return the error that options in the files have changed; some jobs of a sweep may still be the same."""
    if len(saved.configs) == len(launch.configs):
        description = f"a run with another config ({_changes(saved, launch)})"
    else:
        description = f"a sweep of {len(saved.configs)} jobs, which today has {len(launch.configs)}"
    has_same_config = any(config in launch.configs for config in saved.configs)
    advice = "start again in another directory"
    if has_same_config:
        advice = (
            f"resume its jobs one by one, {resume_command(launch.command, directory / '0')} and so on "
            f"({lme_command('table', directory)} tabulates all), or {advice}"
        )
    sources = [entry.files[name].source for entry, name in inputs.differing(saved.inputs, launch.inputs)]
    source_text = f" ({shortened(sources)})" if sources else ""
    return InputError(f"{directory}: holds {description}: {_OUTDATED}{source_text}; {advice}")


def _changes(saved: Launch, launch: Launch) -> str:
    pairs = zip(saved.configs, launch.configs, strict=True)
    return shortened(list(dict.fromkeys(change for old, new in pairs for change in differences(old, new))))


def _command_line(launch: Launch) -> tuple[object, ...]:
    """Return what a launch was started with, apart from Hydra's own part."""
    overrides = [word for word in launch.overrides if not word.startswith("hydra.")]
    return launch.command, launch.multirun, overrides, launch.config_dir, launch.config_name


def holds_run(directory: Path) -> bool:
    """Return whether the directory, or one right below it, holds records or a study.

    Raises InputError if it cannot be read.
    """
    try:
        for prefix in ("", "*/"):
            if any(True for name in _RESULTS for _ in directory.glob(f"{prefix}{name}")):
                return True
            if any(file.stat().st_size for file in directory.glob(f"{prefix}parts/*") if file.is_file()):
                return True
        return False
    except OSError as error:
        raise directory_error(directory, "read", error) from error


@contextlib.contextmanager
def locked(run_dir: Path) -> Iterator[None]:
    """Lock the directory of a run. Raises InputError if another process holds it."""
    with (run_dir / LAUNCH).open("r+b") as file:  # NFS locks only files that are open for writing
        lock(file, run_dir)
        yield


def jobs_of_sweep(sweep_dir: Path, num_jobs: int) -> list[Path]:
    """Return the directories of a sweep's jobs, in the order of the jobs.

    num_jobs: number that the command line implies; a sweeper plugin may run more. A folder with a higher number and
    without records was left by a larger sweep that was stopped.
    """
    records = [(read_launch(folder), folder) for folder in job_folders(sweep_dir)]
    jobs = {record.job: path for record, path in records if record is not None and record.job is not None}
    return [jobs[number] for number in sorted(jobs) if number < num_jobs or holds_run(jobs[number])]


def make_fresh(launch: Launch, folder: Path | None) -> Path:
    """Make the directory of a new run, with its `launch.json` and copies of the user's own files; name these.

    Returns `folder`, or a new directory under `ROOT`.

    Raises InputError if it cannot be written, already holds a run, or belongs to a running process.
    """
    if folder is not None and holds_run(folder):
        raise InputError(f"{folder}: already holds a run: add resume=true or choose another directory")
    directory = _new_directory(launch) if folder is None else _make_directory(folder, exist_ok=True)
    # Another process may be using the directory, even if it has no results yet.
    for path in (directory / LAUNCH, directory / APPEND_LOG):
        with contextlib.suppress(FileNotFoundError, PermissionError), path.open("r+b") as file:
            lock(file, directory)
    launch.write(directory, anew=True)
    inputs.keep(launch.inputs, directory)
    if sentence := inputs.sentence(launch.inputs):
        print(f"lme {launch.command}: {sentence}", file=sys.stderr)
    return directory


def _new_directory(launch: Launch) -> Path:
    """Make a new directory, named by date, time and fingerprint; with a number if another run has that name."""
    name = f"{datetime.now():%Y-%m-%d_%H-%M-%S}-{_fingerprint_suffix(launch)}"
    for number in count(1):
        unique_name = name if number == 1 else f"{name}-{number}"
        with contextlib.suppress(FileExistsError):
            return _make_directory(ROOT / launch.command / unique_name, exist_ok=False)
    raise AssertionError("an endless sequence ended")


def _fingerprint_suffix(launch: Launch) -> str:
    return f"{'sweep-' if launch.multirun else ''}{launch.fingerprint[:8]}"


def _make_directory(directory: Path, exist_ok: bool) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=exist_ok)
    except FileExistsError as error:
        if not exist_ok and directory.is_dir():
            raise
        raise directory_error(directory, "written", error) from error
    except OSError as error:
        raise directory_error(directory, "written", error) from error
    return directory


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
    resolved: set[Path] = set()  # several paths may lead to a run, which is read once
    for folder in folders:
        run_dirs = [folder, *sorted(path.parent for path in folder.rglob(LAUNCH))]
        runs = [run_dir for run_dir in dict.fromkeys(run_dirs) if has_records(run_dir)]
        if not runs:
            problem = "no run below it" if folder.is_dir() else "no such directory"
            raise InputError(f"{folder}: {problem}; run lme eval first, or give folders that hold runs")
        for run_dir in runs:
            if run_dir.resolve() not in resolved:
                resolved.add(run_dir.resolve())
                _add(run_dir, collected)
    return collected


def _add(run_dir: Path, collected: Collected) -> None:
    """Read a run."""
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
