"""Track runs in MLflow.

Importing MLflow and opening its store take seconds, so a thread does both while worker processes run the episodes.
Tracking never stops a run: an error becomes a warning of one line, and the results stay on disk.
"""

from __future__ import annotations

import contextlib
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from lme.errors import InputError
from runners.config.escaping import masked, masked_text, masked_values
from runners.tracking.description import SWEEP, note, run_tags
from runners.tracking.store import (
    DEFAULT_URI,
    NOTE,
    PARENT,
    RUNNING,
    TAG_LENGTH,
    check_uri,
    children,
    end_when_jobs_have,
    experiment_id,
    fitting_text,
    log_metrics,
    log_params,
    log_series,
    noted_run,
    open_client,
    remove_duplicates,
    run_of,
    set_defaults,
    sqlite_path,
    unwritable,
    worst_state,
)
from runners.tracking.tracking import FAILED, FINISHED, KILLED, Series, state_of
from runners.workers.progress import activity

if TYPE_CHECKING:
    from mlflow import MlflowClient


_CONFIG = Path(".hydra") / "config.yaml"  # within a run's directory
_SHOWN = 8  # names in a message at most
_CLOSE_S = 25.0  # longest wait of an interrupted run: Slurm kills 30 s after SIGTERM
_UPLOAD_S = 30.0  # time limit of uploads that fail


@dataclass(slots=True)
class MlflowConfig:
    """Settings of MLflow. uri: that of the store, a database or a server. experiment: name of a group of runs."""

    uri: str
    experiment: str

    def __post_init__(self) -> None:
        check_uri("tracking.uri", self.uri)
        if not self.experiment:
            raise InputError("tracking.experiment is empty: must be a name")


@dataclass(slots=True)
class _OpenRun:
    """A run in the store. parent: the run of its sweep. changed: values that MLflow stores in another form."""

    client: MlflowClient
    run_id: str
    parent: str | None = None
    sweep_dir: Path | None = None
    changed: list[str] = field(default_factory=list)

    def close(self, state: str) -> None:
        """Set the final state, for a sweep that of its worst job; the last job of a sweep closes the sweep too."""
        if self.parent is None or self.sweep_dir is None:
            self.client.set_terminated(self.run_id, worst_state(self.client, self.run_id, state))
        else:
            self.client.set_terminated(self.run_id, state)
            end_when_jobs_have(self.client, self.parent, self.sweep_dir)


class MlflowTracking:
    """Tracking in MLflow: parameters, metrics, files, commit, versions. A resumed run continues its MLflow run."""

    Config = MlflowConfig

    def __init__(self, config: MlflowConfig) -> None:
        self._config = config
        self._opening: threading.Thread | None = None
        self._run: _OpenRun | None = None
        self._run_dir = Path()
        self._stopped = False
        self._error: Exception | None = None

    def start(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None = None,
    ) -> None:
        unwritable_path = unwritable(self._config.uri)
        if unwritable_path is not None:
            _warn_unwritable(unwritable_path, self._config.uri, sweep_dir or run_dir)
            return
        set_defaults()

        def open_run() -> None:
            try:
                self._open(config, run_dir, tags, sweep_dir)
            except Exception as error:
                self._error = error

        # A daemon, so that an interrupted run does not wait for a server that does not answer.
        self._opening = threading.Thread(target=open_run, name="mlflow", daemon=True)
        self._opening.start()

    def finish(
        self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series | None = None
    ) -> None:
        if self._opening is None:
            return
        with activity("Logging to MLflow"):
            self._finish(metrics, artifacts, series or {})
        self._opening = None

    def _finish(self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series) -> None:
        # The run opens in a thread: wait for it, and raise its error here.
        assert self._opening is not None
        self._opening.join()
        uri, run = self._config.uri, self._run
        try:
            if self._error is not None:
                raise self._error
            if run is None:
                return
            run.changed += log_metrics(run.client, run.run_id, metrics)
            log_series(run.client, run.run_id, series)
            lost_files = self._log_files(run, artifacts)
            self._describe(run, artifacts)
            remove_duplicates(run.client, run.run_id)
            run.close(FINISHED)
        except Exception as error:
            _warn(uri, error)
            self.stop(FAILED)
        else:
            # The run is closed; name the values and files that are missing or stored in another form.
            if lost_files:
                _warn_lost(uri, lost_files)
            if run.changed:
                warnings.warn(f"MLflow at {masked(uri)} keeps {_listed(run.changed)}", stacklevel=2)

    def stop(self, state: str) -> None:
        if self._opening is None:
            return
        self._stopped = True
        opening, self._opening = self._opening, None

        def close() -> None:
            opening.join()
            if self._run is not None:
                self._run.close(state)

        _in_time(self._config.uri, close)

    def _open(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None,
    ) -> None:
        uri, self._run_dir = self._config.uri, run_dir
        client = open_client(uri)
        experiment = experiment_id(client, uri, self._config.experiment)
        if self._stopped:
            return
        tags = run_tags(run_dir, tags, sweep_dir)
        parent = None
        if sweep_dir is not None:
            parent = run_of(sweep_dir, client, uri, experiment, run_tags(sweep_dir, {"command": SWEEP}))
            tags[PARENT] = parent
        self._run = _OpenRun(client, run_of(run_dir, client, uri, experiment, tags), parent, sweep_dir)
        self._run.changed += log_params(client, self._run.run_id, config)

    def _log_files(self, run: _OpenRun, artifacts: Sequence[Path]) -> dict[str, Exception]:
        """Log files one by one; return the names of those that could not be logged, and why.

        A store that does not answer costs time for every file, so after a while no more are tried.
        """
        lost_files: dict[str, Exception] = {}
        wasted_s = 0.0
        for name, upload in _uploads(run, self._run_dir, artifacts):
            start_s = time.monotonic()
            try:
                if wasted_s > _UPLOAD_S:
                    raise TimeoutError("the store of files does not answer")
                upload()
            except Exception as error:
                lost_files[name] = error
                wasted_s += time.monotonic() - start_s
        return lost_files

    def _describe(self, run: _OpenRun, artifacts: Sequence[Path]) -> None:
        """Add the table to the description, unless somebody has written another one."""
        tags = run.client.get_run(run.run_id).data.tags
        if tags.get(NOTE) == fitting_text(note(tags), TAG_LENGTH):
            run.client.set_tag(run.run_id, NOTE, fitting_text(note(tags, artifacts), TAG_LENGTH))


def close_sweep(sweep_dir: Path, state: str) -> None:
    """Close the MLflow run of a sweep and those of its jobs that were killed; do nothing if there is no MLflow run.

    state: how the sweep ended. The run gets the worst of this and the states of its jobs. Warns if that fails.
    """
    uri = DEFAULT_URI
    try:
        mlflow_run = noted_run(sweep_dir)
        if mlflow_run is None:
            return
        uri, parent = mlflow_run
        set_defaults()
        _in_time(uri, lambda: _close_sweep(uri, parent, state))
    except Exception as error:
        _warn(uri, error)


def _close_sweep(uri: str, parent: str, state: str) -> None:
    client = open_client(uri)
    for run_id in children(client, parent, RUNNING, max_results=1000):
        client.set_terminated(run_id, KILLED if state == FINISHED else state)
    if client.get_run(parent).info.status == RUNNING:
        client.set_terminated(parent, worst_state(client, parent, state))


@contextlib.contextmanager
def sweep_closed(sweep_dir: Path, goes_on: bool) -> Iterator[None]:
    """Close the MLflow run of a sweep at the end of the block.

    goes_on: whether the jobs continue by themselves if the block fails, and then close the sweep's run.
    """
    try:
        yield
    except BaseException as error:
        if not goes_on:
            close_sweep(sweep_dir, state_of(error))
        raise
    close_sweep(sweep_dir, FINISHED)


def _in_time(uri: str, close: Callable[[], None]) -> None:
    """Close runs within a time limit, so that the command can end even if the store does not answer."""
    failures: list[Exception] = []

    def guarded() -> None:
        try:
            close()
        except Exception as error:
            failures.append(error)

    closing = threading.Thread(target=guarded, name="mlflow-close", daemon=True)
    closing.start()
    closing.join(_CLOSE_S)
    if closing.is_alive():
        failures.append(TimeoutError(f"no answer in {_CLOSE_S:.0f} s"))
    if failures:
        warnings.warn(
            f"MLflow at {masked(uri)} shows this run as RUNNING until it is resumed ({_reason(failures[0])})",
            stacklevel=4,
        )


def _uploads(
    run: _OpenRun, run_dir: Path, artifacts: Sequence[Path]
) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield the name of every file to log, and what logs it: the artifacts, and the config that Hydra composed."""
    for path, folder in _files(artifacts, run_dir):
        yield path.name, partial(run.client.log_artifact, run.run_id, str(path), folder)
    config = run_dir / _CONFIG
    if config.is_file():
        values = masked_values(yaml.safe_load(config.read_text(encoding="utf-8")))
        yield config.name, partial(run.client.log_dict, run.run_id, values, config.name)


def _files(paths: Sequence[Path], run_dir: Path) -> Iterator[tuple[Path, str | None]]:
    """Yield every file of `paths` and of the folders among them, with its folder in MLflow."""
    for path in paths:
        folder = _folder(path, run_dir)
        if not path.is_dir():
            yield path, folder
            continue
        for file in sorted(file for file in path.rglob("*") if file.is_file()):
            artifact_folder = Path(folder or "") / path.name / file.parent.relative_to(path)
            yield file, artifact_folder.as_posix()


def _folder(path: Path, run_dir: Path) -> str | None:
    """Return the folder of a path within the run's directory; None at its top or outside of it."""
    relative = path.parent.relative_to(run_dir) if path.is_relative_to(run_dir) else Path()
    return relative.as_posix() if relative.parts else None


def add_files(run_dir: Path, files: Sequence[Path], folder: str) -> None:
    """Add files to `folder` of the MLflow run of `run_dir`; do nothing if there is no MLflow run.

    Warns if that fails.
    """
    uri = DEFAULT_URI
    try:
        mlflow_run = noted_run(run_dir)
        if mlflow_run is None:
            return
        uri, run_id = mlflow_run
        set_defaults()
        store = sqlite_path(uri)
        if store is not None and not store.is_file():
            raise FileNotFoundError(f"there is no database at {store.resolve()}")
        if unwritable(uri) is not None:
            raise PermissionError(f"{unwritable(uri)} cannot be written")
        client = open_client(uri)
        for path in files:
            client.log_artifact(run_id, str(path), folder)
    except Exception as error:
        _warn(uri, error)


@cache  # once for all jobs of a sweep
def _warn_unwritable(path: Path, uri: str, results: Path) -> None:
    """Warn before a run, without importing MLflow, that its store cannot be written."""
    warnings.warn(
        f"not logged to MLflow at {masked(uri)}: {path} cannot be written; all results go to {results}. "
        "Set MLFLOW_TRACKING_URI to another store, or choose tracking=none",
        stacklevel=3,
    )


def _warn(uri: str, error: Exception) -> None:
    warnings.warn(
        f"not logged to MLflow at {masked(uri)}; the results are on disk ({_reason(error)})",
        stacklevel=3,
    )


def _warn_lost(uri: str, lost_files: Mapping[str, Exception]) -> None:
    """Name the files that could not be logged, and why the first could not."""
    reason = _reason(next(iter(lost_files.values())))
    warnings.warn(
        f"not logged to MLflow at {masked(uri)}: {_listed(list(lost_files))} ({reason}); metrics and other "
        "files are logged",
        stacklevel=3,
    )


def _reason(error: Exception) -> str:
    return masked_text((str(error).splitlines() or [type(error).__name__])[0])[:500]


def _listed(names: Sequence[str]) -> str:
    remainder = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"{', '.join(names[:_SHOWN])}{remainder}"
