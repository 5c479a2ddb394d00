"""`lme.evaluate`: what `lme eval` does, called from Python, for a script or a notebook."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from runners.config import build, command_line
from runners.config.composer import Composer
from runners.config.job import Job
from runners.config.quoting import quoted
from runners.config.schema import EvalConfig
from runners.experiments.evaluate import drive, produce, start_tracking, validate
from runners.experiments.labels import run_labels
from runners.records import launch_record, run_directories
from runners.records.parquet import EPISODES

if TYPE_CHECKING:
    import pandas as pd

_NAME = re.compile(r"[A-Za-z_][\w./-]*")
_NOT_TEXT = ("true", "false", "null", "inf", "nan")  # to Hydra
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
    """The records of one run; see `lme.evaluate`."""
    if resume and into is None:
        raise InputError("resume=True: there is nothing to resume without into=DIR")
    more = {**keys, **({} if workers is None else {"executor.workers": workers})}
    words = _overrides([*overrides, *(f"{key}={to_hydra(value)}" for key, value in more.items())])
    job = _job(words, config_dir)
    if into is not None:
        return _evaluate_into(job, words, Path(into).expanduser(), resume, progress)
    _check_needs_no_directory(job)
    with tempfile.TemporaryDirectory(prefix="lme-") as folder:
        maps = build.map_set(job.config)
        drive(job.config, run_labels(job, maps), maps, Path(folder), progress)
        return _records(Path(folder))


def to_hydra(value: Any) -> str:
    """A Python value in Hydra's grammar. Raises InputError for one that a config cannot hold."""
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, str | Path):
        text = str(value)
        # Names of options must not be quoted in a list.
        return text if _NAME.fullmatch(text) and text.lower() not in _NOT_TEXT else quoted(text)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{to_hydra(each)}" for key, each in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ",".join(map(to_hydra, value)) + "]"
    raise InputError(
        f"{value!r}: must be a string, a number, True, False, None, or a list or mapping of these"
    )


def _overrides(words: list[str]) -> list[str]:
    """The overrides, without tracking unless they choose one. Raises InputError for a key that is a keyword here."""
    given = [word.partition("=")[0].lstrip("+") for word in words]
    for key, word in zip(given, words, strict=True):
        if key in _KEYWORDS:
            raise InputError(f"{word}: must be given as the keyword {_KEYWORDS[key]}")
    return words if "tracking" in given else ["tracking=none", *words]


def _job(words: Sequence[str], config_dir: str | Path | None) -> Job[EvalConfig]:
    """The job, composed and checked as on the command line. Raises InputError, also for a sweep."""
    own = None if config_dir is None else Path(config_dir).expanduser().resolve()
    if own is not None and not own.is_dir():
        raise InputError(f"config_dir {own}: no such directory")
    with Composer("eval", own) as composer:
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
    asked = {"record": job.config.record, "explain": job.config.explain, "tracking": job.choices["tracking"]}
    for key, value in asked.items():
        if value != "none":
            raise InputError(f"{key}={value}: needs into=DIR, the run's directory")


def _evaluate_into(
    job: Job[EvalConfig], words: Sequence[str], run_dir: Path, resume: bool, progress: bool
) -> pd.DataFrame:
    """Drive in a run directory as the command does, and write everything that it writes."""
    from runners.analysis.summary import metrics

    record = launch_record.launch_of("eval", [job], list(words), False, None)
    if resume and run_directories.holds_run(run_dir):
        run_directories.check_same(record, run_dir)
    else:
        run_directories.make_fresh(record, run_dir)
    job = replace(job, run_dir=run_dir)
    tracking = start_tracking(job)
    frame, _, artifacts = produce(job, progress)
    tracking.finish(metrics(frame), artifacts)
    return _records(run_dir)


def _records(run_dir: Path) -> pd.DataFrame:
    """The episodes of a run, as its file holds them."""
    import pandas as pd

    return pd.read_parquet(run_dir / EPISODES)
