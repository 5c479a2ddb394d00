"""MLflow stores: checks their URIs, creates them, and writes runs, parameters and metrics to them."""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from runners.config.flatten import flatten
from runners.records.whole_file import obstacle, write_atomically

if TYPE_CHECKING:
    from mlflow import MlflowClient

DEFAULT_URI = "sqlite:///outputs/mlflow.db"
SQLITE = "sqlite:///"
SCHEMES = ("sqlite", "http", "https", "postgresql", "mysql", "mssql", "databricks")
RUN_ID_FILE = "mlflow_run.json"
_CREATED = "lme_created"  # a tag: equal in runs that the same request created

# MLflow's limits.
KEY_LENGTH = 250
PARAM_LENGTH = 6000
TAG_LENGTH = 5000
BATCH = 100
METRICS_BATCH = 1000

# Defaults for unset variables: give up on an unreachable server in seconds, print nothing, send no telemetry.
DEFAULTS = {
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "2",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
    "MLFLOW_HTTP_REQUEST_BACKOFF_FACTOR": "1",
    "MLFLOW_LOGGING_LEVEL": "WARNING",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
    "MLFLOW_DISABLE_TELEMETRY": "true",
}


def set_defaults() -> None:
    """Set our defaults for MLflow's environment variables. Call it before MLflow is imported."""
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)


def check_uri(key: str, uri: str) -> None:
    """Raise InputError, which names `key`, unless MLflow can store runs at `uri`."""
    scheme, found, _ = uri.partition(":")
    if not found or scheme.partition("+")[0] not in SCHEMES:
        raise InputError(
            f"{key} is {uri}: must be a database or a server, such as {DEFAULT_URI} or http://host:5000"
        )


def sqlite_path(uri: str) -> Path | None:
    """The file of an SQLite store; None for any other store."""
    return Path(uri.removeprefix(SQLITE)) if uri.startswith(SQLITE) else None


def unwritable(uri: str) -> Path | None:
    """The file or folder that prevents writing to an SQLite store; None if nothing does, or for other stores."""
    path = sqlite_path(uri)
    return None if path is None else obstacle(path)


def open_client(uri: str) -> MlflowClient:
    """A client of the store at `uri`. Creates an SQLite store that does not exist."""
    _quieten()
    from mlflow import MlflowClient

    _quieten()  # again, because the import of MLflow sets logging levels
    path = sqlite_path(uri)
    if path is not None and not path.exists():
        _create_store(path)
    return MlflowClient(tracking_uri=uri, registry_uri=uri)


def _create_store(path: Path) -> None:
    """Create the database under a temporary name, and give it its own name when it is complete.

    MLflow creates the tables by migrations, which take seconds. It refuses a database with incomplete migrations.
    """
    from mlflow import MlflowClient

    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    unfinished.touch()  # fails at once, where MLflow would retry for 100 s
    try:
        MlflowClient(tracking_uri=f"{SQLITE}{unfinished}").search_experiments(max_results=1)
        # A link, because a rename would replace a database that another process created meanwhile.
        with contextlib.suppress(FileExistsError):
            os.link(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def experiment_id(client: MlflowClient, uri: str, name: str) -> str:
    """Id of the experiment, created if needed. Its files are stored next to the database, or by the server."""
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is not None:
        return str(found.experiment_id)
    location = None
    if not uri.startswith(("http", "databricks")):
        store = sqlite_path(uri) or Path("outputs") / "mlflow.db"
        location = (store.parent / "mlartifacts").resolve().as_uri()
    try:
        return str(client.create_experiment(name, artifact_location=location))
    except MlflowException:
        found = client.get_experiment_by_name(name)  # another process may have created it meanwhile
        if found is None:
            raise
        return str(found.experiment_id)


def run_of(directory: Path, client: MlflowClient, uri: str, experiment: str, tags: Mapping[str, Any]) -> str:
    """Id of the MLflow run of `directory`: the one noted there if it still exists, else a new one."""
    directory.mkdir(parents=True, exist_ok=True)
    with _locked(directory):  # the jobs of a sweep may ask for its run at the same time
        note = directory / RUN_ID_FILE
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            known = json.loads(note.read_text())
            if known["experiment"] == experiment and _exists(client, known["run"]):
                return str(known["run"])
        texts = {name: str(value)[:TAG_LENGTH] for name, value in tags.items()}
        texts[_CREATED] = uuid.uuid4().hex
        run_id = str(client.create_run(experiment, tags=texts, run_name=_run_name(directory)).info.run_id)
        write_atomically(note, json.dumps({"uri": uri, "experiment": experiment, "run": run_id}) + "\n")
    return run_id


def remove_duplicates(client: MlflowClient, run_id: str) -> None:
    """Remove the other runs that the creation of this one left behind.

    MLflow repeats a request that gets no answer in time, and a server that was only slow then creates two runs.
    """
    run = client.get_run(run_id)
    mark = run.data.tags.get(_CREATED)
    if mark is None:
        return
    for other in client.search_runs([run.info.experiment_id], f"tags.{_CREATED} = '{mark}'"):
        if other.info.run_id != run_id:
            client.delete_run(other.info.run_id)


@contextlib.contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Lock the directory for one process at a time; the lock ends with the process."""
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        yield
        return
    place = os.open(directory, os.O_RDONLY)
    try:
        fcntl.flock(place, fcntl.LOCK_EX)
        yield
    finally:
        os.close(place)


def _exists(client: MlflowClient, run_id: str) -> bool:
    from mlflow.exceptions import MlflowException

    try:
        return str(client.get_run(run_id).info.lifecycle_stage) == "active"
    except MlflowException as error:
        if error.error_code == "RESOURCE_DOES_NOT_EXIST":
            return False
        raise


def _run_name(directory: Path) -> str:
    """The last two folders: date and time, or sweep and number."""
    return "/".join(directory.resolve().parts[-2:])


def log_params(client: MlflowClient, run_id: str, config: Mapping[str, Any]) -> None:
    """Log the parameters that the run does not have yet: MLflow does not allow changes."""
    from mlflow.entities import Param

    known = client.get_run(run_id).data.params
    params = [
        Param(key[:KEY_LENGTH], str(value)[:PARAM_LENGTH])
        for key, value in flatten(config)
        if key[:KEY_LENGTH] not in known
    ]
    for start in range(0, len(params), BATCH):
        client.log_batch(run_id, params=params[start : start + BATCH])


def log_series(client: MlflowClient, run_id: str, series: Mapping[str, Sequence[float]]) -> None:
    """Log metrics with a value for each step; skip steps that were logged before the run was resumed."""
    from mlflow.entities import Metric

    now = int(time.time() * 1000)
    for name, values in series.items():
        known = {metric.step for metric in client.get_metric_history(run_id, name)}
        points = [
            Metric(name, float(value), now, step)
            for step, value in enumerate(values)
            if step not in known and math.isfinite(value)
        ]
        for start in range(0, len(points), METRICS_BATCH):
            client.log_batch(run_id, metrics=points[start : start + METRICS_BATCH])


def _quieten() -> None:
    """Silence the log messages of MLflow, its migrations and retries; errors are raised anyway."""
    for name in ("mlflow", "alembic", "urllib3"):
        logging.getLogger(name).setLevel(logging.ERROR)
