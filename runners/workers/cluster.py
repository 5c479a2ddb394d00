"""Executor that runs the episodes on a dask.distributed cluster, on this machine or on many."""

from __future__ import annotations

import contextlib
import itertools
import logging
import math
import pickle
import re
import sys
import uuid
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lme.errors import InputError, require
from lme.requirements import install
from runners.records.launch_record import versions
from runners.workers.environment import SAFE_PATH, environment
from runners.workers.executor import (
    Initialise,
    Item,
    Map,
    WorkerDiedError,
    available_cores,
    map_once,
    serial_in_launcher,
)
from runners.workers.forkserver import ONE_THREAD, sigint_ignored

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

_ADDRESS = r"\w+://\S+:\d+"
_CONNECT_S = 5.0
_CONNECT_OWN_S = 120.0  # to a cluster that this process has started, while its workers keep every core busy
_NO_WORKER_S = 30  # the run ends if a cluster on this machine has had no worker for this long
_WITHOUT_DASK = "add resume=true, and executor=process to continue without dask"
_BATCHES_PER_WORKER = 4  # of a short list, so that the last batches end at about the same time
_IN_FLIGHT = 10_000  # batches: enough for some thousand workers
_NUMERIC = ("numpy", "numba", "scipy", "onnxruntime")  # packages that may change the last bit of a result


@dataclass(slots=True)
class DaskConfig:
    """Settings of the dask executor.

    address: that of a scheduler; null for a cluster on this machine of `workers` processes (null: one per core).
    batch: maximum number of episodes in a task.
    """

    address: str | None
    workers: int | None
    batch: int

    def __post_init__(self) -> None:
        try:
            import distributed  # noqa: F401
        except ImportError as error:
            hint = install("distributed")
            raise InputError(f"executor=dask needs the package distributed: {hint}") from error
        require("batch", self.batch, at_least=1)
        if self.address is not None and not re.fullmatch(_ADDRESS, self.address):
            raise InputError(f"executor.address is {self.address}: must be null or like tcp://host:8786")
        if self.workers is not None:
            require("workers", self.workers, at_least=1)
            if self.address is not None:
                raise InputError(
                    f"executor.workers is {self.workers}: must be null with executor.address, whose cluster has workers"
                )


class DaskExecutor:
    """Executor that uses the workers of a dask cluster; dask gives the items of a lost worker to another.

    Without an address, inside a worker process of a Hydra launcher, items run in that process, as they do with
    ProcessExecutor.
    """

    Config = DaskConfig

    def __init__(self, config: DaskConfig) -> None:
        self._config = config

    def map(self, initialise: Initialise, payload: Any, items: Iterable[Item]) -> Iterator[Any]:
        """Yield the result of `initialise(payload)` on every item, as they finish.

        initialise: a function at the top level of a module. payload, items: anything that pickles. Raises InputError
        and EpisodeError as ProcessExecutor does; WorkerDiedError if several workers died with a task, or if the
        scheduler is gone.
        """
        return map_once(self.open, self._max_workers, initialise, payload, items)

    @contextlib.contextmanager
    def open(self, initialise: Initialise, payload: Any, at_once: int | None = None) -> Iterator[Map]:
        """Give a `map` for several lists of items; `initialise` is called once in each worker process.

        at_once: length of the longest list, if known: no more workers than that are started on this machine.
        """
        serial = serial_in_launcher("dask") if self._config.address is None else None
        if serial is not None:
            with serial.open(initialise, payload) as run_all:
                yield run_all
            return
        with (
            _quiet_logs(),
            self._client(at_once) as client,
            _registered(client, initialise, payload) as token,
        ):
            yield lambda items: _submit_batches(client, token, items, self._config.batch)

    @property
    def _max_workers(self) -> int:
        """Maximum number of processes of a cluster on this machine."""
        return self._config.workers or available_cores()

    @contextlib.contextmanager
    def _client(self, at_once: int | None) -> Iterator[Client]:
        """Yield a client of the scheduler, or of a cluster on this machine that ends with the `with`."""
        if self._config.address is not None:
            with _connected(self._config.address, _CONNECT_S) as client:
                yield client
            return
        with (
            _local_cluster(
                self._max_workers if at_once is None else min(self._max_workers, at_once)
            ) as cluster,
            _connected(cluster.scheduler_address, _CONNECT_OWN_S) as client,
        ):
            yield client


def _local_cluster(workers: int) -> LocalCluster:
    """Start processes that only this machine can reach. Raises WorkerDiedError if they do not start.

    Dask restarts a process that died, but not one that dies while it starts.
    """
    import dask
    from distributed import LocalCluster

    settings = {
        "distributed.scheduler.no-workers-timeout": f"{_NO_WORKER_S}s",
        "distributed.worker.profile.enabled": False,  # it would look at each worker a hundred times a second
    }
    try:
        with sigint_ignored(), environment(SAFE_PATH), dask.config.set(settings):
            return LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",
                memory_limit=None,
                silence_logs=logging.CRITICAL,
                env=ONE_THREAD,
            )
    except RuntimeError as error:
        raise WorkerDiedError(
            f"executor=dask: no worker process starts ({error}); {_WITHOUT_DASK}"
        ) from error


@contextlib.contextmanager
def _connected(address: str, timeout_s: float) -> Iterator[Client]:
    from distributed import Client

    try:
        client = Client(address, timeout=timeout_s, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"executor.address is {address}: no dask scheduler answers there; start one with `dask scheduler`, "
            "and give the tcp:// address that it prints"
        ) from error
    with client:
        if not client.nthreads():
            print(f"executor=dask: waiting for a worker: dask worker {address} --nthreads 1", file=sys.stderr)
        yield client


@contextlib.contextmanager
def _registered(client: Client, initialise: Initialise, payload: Any) -> Iterator[str]:
    """Give every worker, also those that join later, what the items need; yields its name."""
    from runners.workers.cluster_worker import WorkerSetup

    token = f"lme-{uuid.uuid4().hex}"
    job = WorkerSetup(token, pickle.dumps((initialise, payload)), versions(*_NUMERIC))
    try:
        client.register_plugin(job, name=token)
    except ImportError as error:
        raise InputError(
            f"executor.address: a worker cannot import {error.name}: install the same lme on every machine"
        ) from error
    try:
        yield token
    finally:
        if client.status == "running":
            with contextlib.suppress(OSError, ValueError):
                client.unregister_worker_plugin(token)


def _submit_batches(client: Client, token: str, items: Iterable[Item], batch: int) -> Iterator[Any]:
    """Submit the items in batches; the scheduler gives each worker the next one as soon as it is free.

    The scheduler knows at most `_IN_FLIGHT` batches at once: of a million, each would take some kilobytes of it.
    """
    from distributed import as_completed

    from runners.workers.cluster_worker import run_batch

    # A short list is divided into smaller batches.
    workers = max(sum(client.nthreads().values()), 1)
    remaining = iter(items)
    first_items = list(itertools.islice(remaining, batch * _BATCHES_PER_WORKER * workers))
    size = _batch_size(len(first_items), workers, batch)
    remaining = itertools.chain(first_items, remaining)
    batches = iter(lambda: list(itertools.islice(remaining, size)), [])
    futures: dict[Any, Future[Any]] = {}
    items_of: dict[Any, list[Item]] = {}
    finished = as_completed(loop=client.loop)
    try:
        while True:
            # Submit many at a time, which takes a fraction of the time of one by one.
            room = _IN_FLIGHT - len(futures)
            if room >= _IN_FLIGHT // 2 and (next_batches := list(itertools.islice(batches, room))):
                submitted = client.map(run_batch, next_batches, token=token, pure=False)
                for future, its_items in zip(submitted, next_batches, strict=True):
                    futures[future.key], items_of[future.key] = future, its_items
                finished.update(submitted)
            if not futures:
                break
            future = next(finished)
            results, error = _receive(future, items_of.pop(future.key))
            futures.pop(future.key).release()
            yield from results
            if error is not None:
                raise error
    finally:
        if client.status == "running":
            client.cancel(list(futures.values()))


def _batch_size(items: int, workers: int, max_size: int) -> int:
    """Return the number of items in a batch: `max_size`, or fewer if each worker would get only a few batches."""
    return min(max_size, max(1, math.ceil(items / (_BATCHES_PER_WORKER * max(workers, 1)))))


def _receive(future: Future[Any], items: Sequence[Item]) -> tuple[list[Any], Exception | None]:
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError
    from distributed.scheduler import NoWorkerError

    try:
        result: tuple[list[Any], Exception | None] = future.result()
        return result
    except KilledWorker as error:
        raise WorkerDiedError(
            f"{error.allowed_failures + 1} workers died with {'; '.join(map(str, items))} to run: "
            "finished episodes are kept; add resume=true, with fewer executor.workers if memory ran out"
        ) from None
    except NoWorkerError:
        raise WorkerDiedError(
            "executor=dask: all worker processes died and none starts again: finished episodes are kept; "
            f"{_WITHOUT_DASK}"
        ) from None
    except (CancelledError, CommClosedError):
        raise WorkerDiedError(
            f"the dask scheduler is gone: finished episodes are kept; {_WITHOUT_DASK}"
        ) from None


@contextlib.contextmanager
def _quiet_logs() -> Iterator[None]:
    """Keep dask's messages about lost connections off the terminal: our errors report them in one line."""
    levels = {name: logging.getLogger(name).level for name in ("distributed", "distributed.client")}
    try:
        for name in levels:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
