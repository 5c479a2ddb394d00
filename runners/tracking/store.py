"""Check and create MLflow stores, and write runs, parameters and metrics to them under names that MLflow accepts."""

from __future__ import annotations

import contextlib
import json
import logging
import math
import os
import posixpath
import re
import shlex
import threading
import time
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from lme.inputs.guarded_file import read_json
from runners.config.escaping import masked, masked_text
from runners.records.atomic_write import obstacle, write_atomically
from runners.tracking.tracking import FAILED, FINISHED, KILLED

if TYPE_CHECKING:
    from mlflow import MlflowClient


DEFAULT_URI = "sqlite:///outputs/mlflow.db"
SQLITE = "sqlite:///"
SCHEMES = ("sqlite", "http", "https", "postgresql", "mysql", "mssql", "databricks")
RUN_ID_FILE = "mlflow_run.json"
PARENT = "mlflow.parentRunId"  # MLflow's tag of a child
RUNNING = "RUNNING"
NAME, NOTE = "mlflow.runName", "mlflow.note.content"  # tags of a run's name and of a description
EXPERIMENT_TAGS = {
    "mlflow.experimentKind": "custom_model_development",  # the pages for runs with metrics, not those for agents
    NOTE: "Runs of lme. A run is named for its system, map and robot; the jobs of a sweep lie below its run.",
}
_CREATED = "lme_created"  # a tag: equal in runs that the same request created

# MLflow's limits.
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
KEY_LENGTH = 250
_REFUSED = re.compile(r"[^\w\-. /]" if os.name == "nt" else r"[^\w\-. /:]")


def set_defaults() -> None:
    """Set our defaults for MLflow's environment variables. Call it before MLflow is imported."""
    for name, value in DEFAULTS.items():
        os.environ.setdefault(name, value)


def check_uri(key: str, uri: str) -> None:
    """Raise InputError, which names `key`, unless MLflow can store runs at `uri`."""
    scheme, separator, _ = uri.partition(":")
    if not separator or scheme.partition("+")[0] not in SCHEMES:
        raise InputError(
            f"{key} is {masked(uri)}: must be a database or a server, such as {DEFAULT_URI} or http://host:5000"
        )


def sqlite_path(uri: str) -> Path | None:
    """Return the file of an SQLite store; None for any other store."""
    return Path(uri.removeprefix(SQLITE)) if uri.startswith(SQLITE) else None


def unwritable(uri: str) -> Path | None:
    """Return the file or folder that prevents writing to an SQLite store; None if none does, or for other stores."""
    path = sqlite_path(uri)
    return None if path is None else obstacle(path)


def open_client(uri: str) -> MlflowClient:
    """Return a client of the store at `uri`; create an SQLite store if it does not exist."""
    _quieten()
    from mlflow import MlflowClient

    _quieten()  # again: importing MLflow has reset the logging levels
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
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}")
    unfinished.touch()  # fails at once, where MLflow would retry for 100 s
    try:
        MlflowClient(tracking_uri=f"{SQLITE}{unfinished}").search_experiments(max_results=1)
        # A link, because a rename would replace a database that another process created meanwhile.
        with contextlib.suppress(FileExistsError):
            os.link(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def experiment_id(client: MlflowClient, uri: str, name: str) -> str:
    """Return the id of the experiment, created if needed. Its files are next to the database, or on the server.

    Raises InputError for a deleted experiment.
    """
    from mlflow.exceptions import MlflowException

    experiment = client.get_experiment_by_name(name)
    if experiment is not None:
        if experiment.lifecycle_stage == "deleted":
            raise InputError(
                f"the experiment {name} was deleted: restore it with `MLFLOW_TRACKING_URI={shlex.quote(masked(uri))} "
                f"mlflow experiments restore --experiment-id {experiment.experiment_id}`, then add "
                "resume=true; or choose "
                "another with tracking.experiment=NAME"
            )
        return str(experiment.experiment_id)
    # Create the experiment. Without a server its files go next to the database.
    location = None
    if not uri.startswith(("http", "databricks")):
        store = sqlite_path(uri) or Path("outputs") / "mlflow.db"
        location = (store.parent / "mlartifacts").resolve().as_uri()
    try:
        return str(client.create_experiment(name, artifact_location=location, tags=EXPERIMENT_TAGS))
    except MlflowException:
        experiment = client.get_experiment_by_name(name)  # another process may have created it meanwhile
        if experiment is None:
            raise
        return str(experiment.experiment_id)


def run_of(directory: Path, client: MlflowClient, uri: str, experiment: str, tags: Mapping[str, Any]) -> str:
    """Return the id of the MLflow run of `directory`, set to RUNNING: the run noted there, or else a new one."""
    directory.mkdir(parents=True, exist_ok=True)
    with _locked(directory):  # the jobs of a sweep may ask for its run at the same time
        note = directory / RUN_ID_FILE
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            saved_note = read_json(note)
            if saved_note["experiment"] == experiment and _exists(client, saved_note["run"]):
                client.update_run(saved_note["run"], status=RUNNING)
                return str(saved_note["run"])
        texts = {
            key: fitting_text(value, TAG_LENGTH)
            for key, value in zip(fitting_names(list(tags)), tags.values(), strict=True)
        }
        texts[_CREATED] = uuid.uuid4().hex
        run_id = str(client.create_run(experiment, tags=texts).info.run_id)
        write_atomically(note, json.dumps({"uri": uri, "experiment": experiment, "run": run_id}) + "\n")
    return run_id


def noted_run(directory: Path) -> tuple[str, str] | None:
    """Return the store and the id of the MLflow run of `directory`; None if there is no such run.

    Raises ValueError or KeyError for a damaged note.
    """
    note = directory / RUN_ID_FILE
    if not note.is_file():
        return None
    saved_note = read_json(note)
    return str(saved_note.get("uri", DEFAULT_URI)), str(saved_note["run"])


def end_when_jobs_have(client: MlflowClient, parent: str, sweep_dir: Path) -> None:
    """Close the run of a sweep, with the worst state of its jobs, once all of them have ended.

    A launcher may run the jobs after the process that submitted them has ended, so every job looks at the others.
    """
    # slow to import, and `lme doctor` does not need it
    from runners.records.launch_record import job_folders, sweep_launch

    launch = sweep_launch(sweep_dir)
    num_started = sum(1 for _ in job_folders(sweep_dir, RUN_ID_FILE))
    if launch is not None and launch.num_jobs is not None and num_started < launch.num_jobs:
        return
    if not children(client, parent, RUNNING):
        client.set_terminated(parent, worst_state(client, parent, FINISHED))


def children(client: MlflowClient, parent: str, state: str, max_results: int = 1) -> list[str]:
    """Return the ids of at most `max_results` runs of a sweep's jobs that are in this state."""
    experiment = client.get_run(parent).info.experiment_id
    query = f"tags.`{PARENT}` = '{parent}' and attributes.status = '{state}'"
    return [run.info.run_id for run in client.search_runs([experiment], query, max_results=max_results)]


def worst_state(client: MlflowClient, parent: str, parent_state: str) -> str:
    """Return the worst state of the runs of a sweep's jobs, and of `parent_state`."""
    return next(
        (state for state in (FAILED, KILLED) if parent_state == state or children(client, parent, state)),
        parent_state,
    )


def remove_duplicates(client: MlflowClient, run_id: str) -> None:
    """Remove duplicates that the creation of this run left behind.

    MLflow repeats a request that gets no answer in time, and a server that was only slow then creates two runs.
    """
    run = client.get_run(run_id)
    mark = run.data.tags.get(_CREATED)
    if mark is None:
        return
    for duplicate in client.search_runs([run.info.experiment_id], f"tags.{_CREATED} = '{mark}'"):
        if duplicate.info.run_id != run_id:
            client.delete_run(duplicate.info.run_id)


@contextlib.contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Lock the directory for one process at a time; the lock ends with the process."""
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        yield
        return
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _exists(client: MlflowClient, run_id: str) -> bool:
    from mlflow.exceptions import MlflowException

    try:
        return str(client.get_run(run_id).info.lifecycle_stage) == "active"
    except MlflowException as error:
        if error.error_code == "RESOURCE_DOES_NOT_EXIST":
            return False
        raise


def log_params(client: MlflowClient, run_id: str, config: Mapping[str, Any]) -> list[str]:
    """Log the parameters that the run does not have yet: MLflow does not allow changes.

    Returns a description of each that MLflow cannot store as it is.
    """
    from mlflow.entities import Param

    from runners.config.changes import flatten

    logged = client.get_run(run_id).data.params
    values = {str(key): str(value) for key, value in flatten(config)}
    names = dict(zip(values, fitting_names(list(values)), strict=True))
    new_params = {key: value for key, value in values.items() if names[key] not in logged}
    params = [Param(names[key], fitting_text(value, PARAM_LENGTH)) for key, value in new_params.items()]
    for start in range(0, len(params), BATCH):
        client.log_batch(run_id, params=params[start : start + BATCH])
    cut = [
        f"the first {PARAM_LENGTH} of the {len(value)} characters of {key:.80}"
        for key, value in new_params.items()
        if len(value) > PARAM_LENGTH
    ]
    return [*renamed(new_params, [names[key] for key in new_params]), *cut]


def log_metrics(client: MlflowClient, run_id: str, metrics: Mapping[str, float]) -> list[str]:
    """Log numbers; return a description of each that MLflow cannot store as it is."""
    from mlflow.entities import Metric

    time_ms = int(time.time() * 1000)
    values = {str(key): float(value) for key, value in metrics.items() if isinstance(value, Real)}
    names = fitting_names(list(values))
    points = [Metric(name, value, time_ms, 0) for name, value in zip(names, values.values(), strict=True)]
    for start in range(0, len(points), METRICS_BATCH):
        client.log_batch(run_id, metrics=points[start : start + METRICS_BATCH])
    infinite = [
        f"{key:.80}, which is {value}, as ±1.8e+308" for key, value in values.items() if math.isinf(value)
    ]
    skipped = [
        f"{key:.80}, which is {value!r:.80}, not at all"
        for key, value in metrics.items()
        if key not in values
    ]
    return [*renamed(values, names), *infinite, *skipped]


def log_series(client: MlflowClient, run_id: str, series: Mapping[str, Sequence[float]]) -> None:
    """Log metrics with a value for each step; skip steps that were logged before the run was resumed."""
    from mlflow.entities import Metric

    time_ms = int(time.time() * 1000)
    for name, values in zip(fitting_names(list(series)), series.values(), strict=True):
        logged_steps = {metric.step for metric in client.get_metric_history(run_id, name)}
        points = [
            Metric(name, float(value), time_ms, step)
            for step, value in enumerate(values)
            if step not in logged_steps and math.isfinite(value)
        ]
        for start in range(0, len(points), METRICS_BATCH):
            client.log_batch(run_id, metrics=points[start : start + METRICS_BATCH])


def _quieten() -> None:
    """Silence the log messages of MLflow, its migrations and retries; errors are raised anyway."""
    for name in ("mlflow", "alembic", "urllib3"):
        logging.getLogger(name).setLevel(logging.ERROR)


def fitting_names(names: Sequence[str]) -> list[str]:
    """Return for each name one that MLflow accepts; all differ, and accepted names stay as they are."""
    unchanged = {name for name in names if _fits(name)}
    assigned: set[str] = set()
    names_out = []
    for name in names:
        if name in unchanged and name not in assigned:
            assigned.add(name)
            names_out.append(name)
            continue
        new_name = _unused(_cleaned(name), unchanged | assigned)
        assigned.add(new_name)
        names_out.append(new_name)
    return names_out


def fitting_text(value: object, length: int) -> str:
    """Return a value as text that every store can hold: not too long, without passwords or lone surrogates."""
    text = masked_text(str(value)).replace("\0", "�")
    return text.encode(errors="replace").decode()[:length]


def renamed(names: Iterable[str], new_names: Iterable[str]) -> list[str]:
    """Return "a as b" for every name that was changed."""
    return [
        f"{name!r:.80} as {new_name!r:.80}"
        for name, new_name in zip(names, new_names, strict=True)
        if name != new_name
    ]


def _fits(name: str) -> bool:
    """Return whether MLflow accepts the name: it may become the path of a file, which must not be another's."""
    is_path = posixpath.normpath(name) == name and not name.startswith(("..", "/")) and name != "."
    return bool(name) and len(name) <= KEY_LENGTH and not _REFUSED.search(name) and is_path


def _cleaned(name: str) -> str:
    segments = _REFUSED.sub("_", name).split("/")
    clean = "/".join("_" if segment in ("", ".", "..") else segment for segment in segments)[:KEY_LENGTH]
    return clean if _fits(clean) else re.sub(r"^\.+|/", "_", clean)


def _unused(name: str, taken_names: set[str]) -> str:
    """Return the name, with a number if another has it already."""
    number, candidate = 1, name
    while candidate in taken_names:
        number += 1
        suffix = f"_{number}"
        candidate = name[: KEY_LENGTH - len(suffix)] + suffix
    return candidate
