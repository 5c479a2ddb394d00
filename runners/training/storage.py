"""Shared storage of a study, at a URL of Optuna, and the heartbeats that show it which processes live."""

from __future__ import annotations

import random
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from lme.requirements import install
from runners.config.escaping import HIDDEN, fault_of_password, masked, reveals_password
from runners.training.optuna_private import id_of

if TYPE_CHECKING:
    import optuna
    from optuna.storages import BaseStorage, RDBStorage
    from sqlalchemy.exc import OperationalError


HEARTBEAT_S = 10  # [s] between heartbeats of a running trial
GRACE_S = 60  # [s] without a heartbeat after which another process takes a trial
_LIBRARIES = ("optuna", "sqlalchemy", "redis")  # libraries whose errors come from a storage
_REDIS = ("redis://", "rediss://", "unix://")
_PACKAGES = {"MySQLdb": "mysqlclient", "psycopg2": "psycopg2-binary"}  # packages by the name of their module
_RIGHT = "must be an Optuna storage URL such as postgresql://user@host/optuna, or null for a journal"
_CREATIONS = 6  # attempts to create the tables while other processes do the same


def open_storage(url: str) -> BaseStorage:
    """Open the storage at an Optuna URL: a database, or redis:// for a journal. Raises InputError if unusable."""
    with _as_input_error(url, "cannot be used", _RIGHT), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Optuna's warnings that Redis and heartbeats are experimental
        if not url.startswith(_REDIS):
            return _database(url)
        from optuna.storages import JournalStorage
        from optuna.storages.journal import JournalRedisBackend

        return JournalStorage(JournalRedisBackend(url))


@contextmanager
def storage_errors(url: str | None, advice: str) -> Iterator[None]:
    """Turn a storage error in the block into an InputError. advice: what the user can do."""
    try:
        yield
    except Exception as error:
        if url is None or type(error).__module__.partition(".")[0] not in _LIBRARIES:
            raise
        with _as_input_error(url, "no longer answers", advice):
            raise


def _database(url: str) -> RDBStorage:
    """Open a database; try again if another process, started together, creates its tables at the same time."""
    from optuna.exceptions import StorageInternalError
    from optuna.storages import RDBStorage, RetryHeartbeatStaleTrialCallback
    from sqlalchemy.exc import IntegrityError, OperationalError, ProgrammingError

    # Name the driver, because SQLAlchemy 2.0 and 2.1 choose different ones.
    driver_url = url.replace("postgresql://", "postgresql+psycopg://", 1)
    for attempt in range(1, _CREATIONS + 1):
        try:
            return RDBStorage(
                driver_url,
                engine_kwargs=_engine_options(url),
                heartbeat_interval=HEARTBEAT_S,
                grace_period=GRACE_S,
                heartbeat_stale_trial_callback=RetryHeartbeatStaleTrialCallback(),
            )
        except (IntegrityError, OperationalError, ProgrammingError, StorageInternalError) as error:
            refused = isinstance(error, OperationalError) and not _already_in_mysql(error)
            if refused or attempt == _CREATIONS:
                raise
            time.sleep(random.uniform(0.1, 0.5))
    raise AssertionError("unreachable: the last attempt returns or raises")


def _already_in_mysql(error: OperationalError) -> bool:
    """Return whether MySQL says that another process has already created the table or the index."""
    return error.orig is not None and error.orig.args[:1] in ((1050,), (1061,))


def _engine_options(url: str) -> dict[str, Any]:
    """Return options of the engine, to give up on an unreachable server in seconds and to survive its restart."""
    if url.startswith(("postgresql", "mysql")):
        return {"connect_args": {"connect_timeout": 10}, "pool_pre_ping": True}
    return {"connect_args": {"timeout": 30}} if url.startswith("sqlite") else {}


@contextmanager
def _as_input_error(url: str, problem: str, advice: str) -> Iterator[None]:
    """Turn any error of the block into an InputError of one line."""
    try:
        yield
    except Exception as error:
        cause: BaseException = error
        while cause.__cause__ is not None:
            cause = cause.__cause__
        if isinstance(cause, ImportError) and cause.name is not None:
            problem, advice = f"needs {cause.name}", install(_PACKAGES.get(cause.name, cause.name))
        reason = " ".join(str(cause).split()) or type(cause).__name__
        if reveals_password(reason, url):
            reason = fault_of_password(url) or type(cause).__name__
        elif url == masked(url) and f":{HIDDEN}@" in url:  # the masked URL of a resumed run
            advice = (
                "its password is not kept with the run: give storage=URL again, or let the driver read it"
            )
        raise InputError(f"storage is {masked(url)}: {problem} ({reason[:200]}); {advice}") from None


class Heartbeat:
    """Heartbeats of this process's trials. storage: None if it does not store any (a journal).

    Optuna sends them only from `Study.optimize`, which runs one trial at a time. `RDBStorage.record_heartbeat` is
    public, and so is `fail_stale_trials`.
    """

    def __init__(self, storage: RDBStorage | None) -> None:
        self._storage = storage
        self._running_trials: set[int] = set()
        self._trials_with_heartbeat: set[int] = set()

    @property
    def finds_killed(self) -> bool:
        """Return whether the trials of killed processes are found."""
        return self._storage is not None

    def begin(self, trial_id: int) -> None:
        """Start the heartbeat of a trial that this process runs."""
        if self._storage is not None:
            self._storage.record_heartbeat(trial_id)
            self._trials_with_heartbeat.add(trial_id)
            self._running_trials.add(trial_id)

    def end(self, trial_id: int) -> None:
        """Stop the heartbeat of a trial."""
        self._running_trials.discard(trial_id)

    @contextmanager
    def send_heartbeats(self) -> Iterator[None]:
        """Send heartbeats while the block runs."""
        stop = Event()
        if self._storage is not None:
            Thread(target=self._beat, args=(self._storage, stop), daemon=True).start()
        try:
            yield
        finally:
            stop.set()

    def requeue_killed(self, study: optuna.Study) -> None:
        """Queue the trials of killed processes again, with their parameters and scores."""
        from optuna.storages import fail_stale_trials
        from optuna.trial import TrialState

        if self._storage is None:
            return
        for trial in study.get_trials(deepcopy=False, states=(TrialState.RUNNING,)):
            # A process may be killed before the first heartbeat, and Optuna only notices trials that had one.
            if id_of(trial) not in self._trials_with_heartbeat:
                self._storage.record_heartbeat(id_of(trial))
                self._trials_with_heartbeat.add(id_of(trial))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Optuna's warning that it is experimental
            fail_stale_trials(study)

    def _beat(self, storage: RDBStorage, stop: Event) -> None:
        interval = storage.get_heartbeat_interval()
        while not stop.wait(interval):
            for trial_id in tuple(self._running_trials):
                with suppress(Exception):  # if the storage does not answer, the search itself reports it
                    storage.record_heartbeat(trial_id)
