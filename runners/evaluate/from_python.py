"""`lme.evaluate`: the command `lme eval` as a Python function, for scripts and notebooks."""

from __future__ import annotations

import contextlib
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from lme.inputs.guarded_file import expanded
from runners.config import build, command_line
from runners.config.arguments import check_config_dir
from runners.config.composer import Composer
from runners.config.job import Job
from runners.config.quoting import key_of, quoted, value_text
from runners.config.schema import EvalConfig
from runners.evaluate.evaluate import drive, run_labels, validate
from runners.evaluate.evaluate import evaluate as evaluate_job
from runners.records import launch_record, run_directories, trust
from runners.records.records import episode_tables

if TYPE_CHECKING:
    import pandas as pd

_NAME = re.compile(r"[A-Za-z_][\w./-]*")
_NOT_TEXT = ("true", "false", "null", "inf", "nan")  # keywords of Hydra's grammar
_IN_PYTHON = (  # wording of messages on the command line, and in Python
    (r"add -m to run each of them", "call lme.evaluate for each of them"),
    (r"several are a sweep: -m \S+", "call lme.evaluate for each of several"),
    (r"--config-dir DIR", "config_dir=DIR"),
    (
        r"^executor\.workers: no such key.*",
        "workers: executor=serial has none; omit it, or choose executor=process",
    ),
    (r"add resume=true", "give resume=True"),
    (r"resume it with resume=PATH alone", "resume it with resume=True and what it was started with"),
    (r"hydra\.run\.dir=PATH", "into=DIR"),
)
_KEYWORDS = {"resume": "resume=True", "hydra.run.dir": "into=DIR", "hydra.sweep.dir": "into=DIR"}


def evaluate(
    overrides: Sequence[str],
    keys: Mapping[str, Any],
    *,
    into: str | Path | None,
    resume: bool,
    workers: int | None,
    config_dir: str | Path | None,
    progress: bool,
) -> pd.DataFrame:
    """Return the records of one run; see `lme.evaluate`."""
    run_dir, folder = _path("into", into), _path("config_dir", config_dir)
    if resume and run_dir is None:
        raise InputError("resume=True: there is nothing to resume without into=DIR")
    with _in_pythons_words():
        # Compose and check the job as on the command line.
        words = _words(overrides, keys, workers)
        job = _job(words, folder)
        # Without a directory of the caller's, drive in a temporary one and write nothing but the records.
        if run_dir is None:
            _check_needs_no_directory(job)
            with tempfile.TemporaryDirectory(prefix="lme-") as name:
                maps = build.map_set(job.config)
                drive(job.config, run_labels(job, maps), maps, Path(name), progress)
                return _records(Path(name))
        # Otherwise write everything that the command writes.
        record = launch_record.launch_of("eval", [job], words, False, None)
        if resume and run_directories.holds_run(run_dir):
            run_directories.check_same(record, run_dir)
        else:
            run_directories.make_fresh(record, run_dir)
        with trust.trusting(run_dir):  # whose config is the one just composed
            evaluate_job(replace(job, run_dir=run_dir), progress=progress, summary=False)
        return _records(run_dir)


def to_hydra(value: Any) -> str:
    """Return a Python value in Hydra's grammar. Raises InputError for one that a config cannot hold."""
    if hasattr(value, "tolist"):  # a value of NumPy
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return value_text(value)
    if isinstance(value, str | Path):
        text = str(value)
        # Names of options must not be quoted in a list.
        return text if _NAME.fullmatch(text) and text.lower() not in _NOT_TEXT else quoted(text)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{to_hydra(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ",".join(map(to_hydra, value)) + "]"
    raise InputError(
        f"{value!r}: must be a string, a number, True, False, None, or a list or mapping of these"
    )


@contextlib.contextmanager
def _in_pythons_words() -> Iterator[None]:
    """Translate messages about the command line into Python arguments."""
    try:
        yield
    except InputError as error:
        message = str(error)
        for pattern, words in _IN_PYTHON:
            message = re.sub(pattern, words, message)
        raise InputError(message) from error


def _path(keyword: str, path: str | Path | None) -> Path | None:
    if path is not None and not isinstance(path, str | Path):
        raise InputError(f"{keyword}={path!r}: must be a path or None")
    return None if path is None else expanded(path)


def _words(overrides: Sequence[str], keys: Mapping[str, Any], workers: int | None) -> list[str]:
    """Return all arguments of the caller as overrides, with tracking=none if they choose none. Raises InputError."""
    for word in overrides:
        if not isinstance(word, str):
            raise InputError(f'{word!r}: must be text, key=value, such as "map=barn"')
    settings = {**keys, **({} if workers is None else {"executor.workers": workers})}
    words = [*overrides, *(f"{key}={to_hydra(value)}" for key, value in settings.items())]
    for word in words:
        if key_of(word) in _KEYWORDS:
            raise InputError(f"{word}: must be given as the keyword {_KEYWORDS[key_of(word)]}")
    return words if "tracking" in map(key_of, words) else ["tracking=none", *words]


def _job(words: Sequence[str], folder: Path | None) -> Job[EvalConfig]:
    """Return the job, composed and checked as on the command line. Raises InputError, also for a sweep."""
    if folder is not None:
        check_config_dir(folder, "config_dir=")
    with Composer("eval", folder and folder.resolve()) as composer:
        plan = command_line.plan(composer, words, multirun=False, typed=words)
        if plan.multirun:
            raise InputError(
                f"{' '.join(words)}: a sweep of {plan.num_jobs} jobs: lme.evaluate drives one; call it for each, "
                "or use lme eval"
            )
        (job,) = command_line.validated(plan, composer, validate)
    return job


def _check_needs_no_directory(job: Job[EvalConfig]) -> None:
    """Raise InputError for a job that asks for files or a tracked run, which need a directory."""
    requests = {
        "record": job.config.record,
        "explain": job.config.explain,
        "tracking": job.choices["tracking"],
    }
    for key, value in requests.items():
        if value != "none":
            raise InputError(f"{key}={value}: needs into=DIR, the run's directory")


def _records(run_dir: Path) -> pd.DataFrame:
    """Return the episodes of a finished run, with the columns of its file."""
    ((table, _),) = episode_tables([run_dir])
    frame: pd.DataFrame = table.to_pandas()
    return frame
