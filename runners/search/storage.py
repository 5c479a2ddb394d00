"""The storage of a study that several machines share, at an Optuna URL."""

from __future__ import annotations

import random
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from lme.requirements import install
from runners.config.urls import HIDDEN, fault_of_password, masked, reveals_password

if TYPE_CHECKING:
    from optuna.storages import BaseStorage, RDBStorage
    from sqlalchemy.exc import OperationalError

HEARTBEAT_S = 10  # between heartbeats of a running trial
GRACE_S = 60  # after this long without a heartbeat, another process takes a trial
_LIBRARIES = ("optuna", "sqlalchemy", "redis")  # their errors come from a storage
_REDIS = ("redis://", "rediss://", "unix://")
_PACKAGES = {"MySQLdb": "mysqlclient", "psycopg2": "psycopg2-binary"}  # by the name of their module
_RIGHT = "must be an Optuna storage URL such as postgresql://user@host/optuna, or null for a journal"
_CREATIONS = 6  # attempts to create the tables while other processes do the same


def open_storage(url: str) -> BaseStorage:
    """The storage at an Optuna URL: a database, or redis:// for a journal. Raises InputError if it cannot be used."""
    with _as_input_error(url, "cannot be used", _RIGHT), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Optuna's warnings that Redis and heartbeats are experimental
        return _redis(url) if url.startswith(_REDIS) else _database(url)


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


def _redis(url: str) -> BaseStorage:
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalRedisBackend

    return JournalStorage(JournalRedisBackend(url))


def _database(url: str) -> RDBStorage:
    """Open a database. Processes that start together all create its tables, and all but one of them fail."""
    from optuna.exceptions import StorageInternalError
    from optuna.storages import RDBStorage, RetryHeartbeatStaleTrialCallback
    from sqlalchemy.exc import IntegrityError, OperationalError, ProgrammingError

    # SQLAlchemy 2.0 and 2.1 choose different drivers for this.
    named = url.replace("postgresql://", "postgresql+psycopg://", 1)
    for attempt in range(1, _CREATIONS + 1):
        try:
            return RDBStorage(
                named,
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
    """Whether MySQL says that another process has already created the table or the index."""
    return error.orig is not None and error.orig.args[:1] in ((1050,), (1061,))


def _engine_options(url: str) -> dict[str, Any]:
    """Options of the engine: give up on an unreachable server within seconds, survive the restart of a server."""
    if url.startswith(("postgresql", "mysql")):
        return {"connect_args": {"connect_timeout": 10}, "pool_pre_ping": True}
    return {"connect_args": {"timeout": 30}} if url.startswith("sqlite") else {}


@contextmanager
def _as_input_error(url: str, trouble: str, advice: str) -> Iterator[None]:
    """Turn any error of the block into an InputError of one line."""
    try:
        yield
    except Exception as error:
        *_, cause = _causes(error)
        if isinstance(cause, ImportError) and cause.name is not None:
            trouble, advice = f"needs {cause.name}", install(_PACKAGES.get(cause.name, cause.name))
        reason = " ".join(str(cause).split()) or type(cause).__name__
        if reveals_password(reason, url):
            reason = fault_of_password(url) or type(cause).__name__
        elif url == masked(url) and f":{HIDDEN}@" in url:  # as a run keeps it that is resumed
            advice = (
                "its password is not kept with the run: give storage=URL again, or let the driver read it"
            )
        raise InputError(f"storage is {masked(url)}: {trouble} ({reason[:200]}); {advice}") from None


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """The error and its causes."""
    while error is not None:
        yield error
        error = error.__cause__
