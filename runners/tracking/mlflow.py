"""Tracks runs in MLflow, or not at all.

Importing MLflow and opening its store take seconds, so a thread does both while worker processes run the episodes.
Tracking never stops a run: an error becomes a warning of one line, and the results stay on disk.
"""

from __future__ import annotations

import json
import math
import platform
import threading
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from lme.errors import InputError
from runners.records.versions import commit, versions
from runners.tracking.store import (
    DEFAULT_URI,
    KEY_LENGTH,
    RUN_ID_FILE,
    check_uri,
    experiment_id,
    log_params,
    log_series,
    open_client,
    remove_duplicates,
    run_of,
    set_defaults,
    sqlite_path,
    unwritable,
)

if TYPE_CHECKING:
    from mlflow import MlflowClient

Series = Mapping[str, Sequence[float]]


class Tracking(Protocol):
    """Logs one run. `start` returns at once; `finish` is called once, at the end."""

    def start(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None = None,
    ) -> None:
        """Open a run with the config as parameters; in a sweep, as a child of the run of `sweep_dir`."""

    def finish(
        self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series | None = None
    ) -> None:
        """Log the results and close the run.

        artifacts: files, and folders with their contents. series: one value per step from 0 on, by name.
        """


@dataclass(slots=True)
class NoTrackingConfig:
    """No settings."""


class NoTracking:
    """Logs nothing. The results are on disk anyway."""

    Config = NoTrackingConfig

    def __init__(self, config: NoTrackingConfig) -> None:
        self._config = config

    def start(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None = None,
    ) -> None:
        """Nothing."""

    def finish(
        self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series | None = None
    ) -> None:
        """Nothing."""


@dataclass(slots=True)
class MlflowConfig:
    """uri: of the store, a database or a server. experiment: MLflow's name for a group of runs."""

    uri: str = DEFAULT_URI
    experiment: str = "lme"

    def __post_init__(self) -> None:
        check_uri("tracking.uri", self.uri)
        if not self.experiment:
            raise InputError("tracking.experiment is empty: must be a name")


class MlflowTracking:
    """Logs a run in MLflow: parameters, metrics, files, commit and versions. A resumed run continues its MLflow run."""

    Config = MlflowConfig

    def __init__(self, config: MlflowConfig) -> None:
        self._config = config
        self._opening: threading.Thread | None = None
        self._client: MlflowClient | None = None
        self._run_id = ""
        self._run_dir = Path()
        self._error: Exception | None = None

    def start(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None = None,
    ) -> None:
        place = unwritable(self._config.uri)
        if place is not None:
            _warn_unwritable(place, self._config.uri, sweep_dir or run_dir)
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
        if self._opening is not None:
            self._opening.join()
        try:
            if self._error is not None:
                raise self._error
            self._log_results(metrics, artifacts, series or {})
        except Exception as error:
            _warn(self._config.uri, error)

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
        tags = {**environment_tags(), **tags, "run_dir": run_dir.resolve()}
        if sweep_dir is not None:
            parent = run_of(sweep_dir, client, uri, experiment, {"run_dir": sweep_dir.resolve()})
            client.set_terminated(parent)
            tags["mlflow.parentRunId"] = parent
        self._run_id = run_of(run_dir, client, uri, experiment, tags)
        log_params(client, self._run_id, config)
        self._client = client

    def _log_results(self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series) -> None:
        if self._client is None:
            return
        for name, value in metrics.items():
            if math.isfinite(value):
                self._client.log_metric(self._run_id, name[:KEY_LENGTH], float(value))
        log_series(self._client, self._run_id, series)
        for path in artifacts:
            self._client.log_artifact(self._run_id, str(path), _folder(path, self._run_dir))
        remove_duplicates(self._client, self._run_id)
        self._client.set_terminated(self._run_id)


def _folder(path: Path, run_dir: Path) -> str | None:
    """The folder of a file or folder within the run's directory; None at its top or elsewhere."""
    place = path.parent.relative_to(run_dir) if path.is_relative_to(run_dir) else Path()
    return place.as_posix() if place.parts else None


def add_files(run_dir: Path, files: Sequence[Path], folder: str) -> None:
    """Add files to `folder` of the MLflow run of `run_dir`; do nothing if there is no MLflow run.

    Warns if that fails.
    """
    note = run_dir / RUN_ID_FILE
    if not note.is_file():
        return
    set_defaults()
    uri = DEFAULT_URI
    try:
        known = json.loads(note.read_text())
        uri, run_id = str(known.get("uri", DEFAULT_URI)), str(known["run"])
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
def _warn_unwritable(place: Path, uri: str, results: Path) -> None:
    """Warn before a run, without importing MLflow, that its store cannot be written."""
    warnings.warn(
        f"not logged to MLflow at {uri}: {place} cannot be written; all results go to {results}. "
        "Set MLFLOW_TRACKING_URI to another store, or choose tracking=none",
        stacklevel=3,
    )


def _warn(uri: str, error: Exception) -> None:
    reason = (str(error).splitlines() or [type(error).__name__])[0]
    warnings.warn(
        f"not logged to MLflow at {uri}; the results are on disk ({reason[:300]})",
        stacklevel=3,
    )


def environment_tags() -> dict[str, str]:
    """Tags with what the results may depend on besides the config: commit, versions, platform."""
    return {"platform": platform.platform(), **versions("numpy", "numba"), **_git_tags()}


def _git_tags() -> dict[str, str]:
    """Commit of the checkout, and whether it has uncommitted changes; {} in an installed wheel."""
    found = commit()
    if found is None:
        return {}
    return {"mlflow.source.git.commit": found.number, "git_changed": str(found.changed).lower()}
