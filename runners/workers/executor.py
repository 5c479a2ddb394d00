"""Who runs the episodes: this process, or a pool of worker processes. The answers are the same.

A job is split in two: `initialise(payload)` builds what every episode needs, once per process, and returns
the function that runs one item. Results come as they finish. `map` serves one list of items; `open` keeps the
processes for list after list.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing import connection, forkserver, get_all_start_methods, get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from lme.errors import InputError
from lme.robots import require

Item = Any  # anything that pickles; messages name it by its str()
Run = Callable[[Item], Any]
Initialise = Callable[[Any], Run]
Map = Callable[[Iterable[Item]], Iterator[Any]]  # items to results, as they finish

# One thread per worker: the workers are the parallelism.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
_JOIN_S = 5.0


class EpisodeError(RuntimeError):
    """An episode failed for a reason that is no user's mistake. Names its world and run."""


class WorkerDiedError(RuntimeError):
    """A worker process ended in the middle of an episode: killed, or out of memory."""


@dataclass(slots=True)
class SerialConfig:
    """Nothing to choose."""


class SerialExecutor:
    """Runs everything in this process, one item after the other: for debugging and profiling."""

    Config = SerialConfig

    def __init__(self, config: SerialConfig) -> None:
        self._config = config

    def map(self, initialise: Initialise, payload: Any, items: Iterable[Item]) -> Iterator[Any]:
        """Results of `initialise(payload)` on every item, in their order."""
        with self.open(initialise, payload) as run_all:
            yield from run_all(items)

    @contextlib.contextmanager
    def open(self, initialise: Initialise, payload: Any, at_once: int | None = None) -> Iterator[Map]:
        """The same for list after list of items; `initialise` is called once."""
        run = initialise(payload)

        def run_all(items: Iterable[Item]) -> Iterator[Any]:
            for item in items:
                try:
                    result = run(item)
                except Exception as error:
                    raise _portable(error, item) from error
                yield result

        yield run_all


@dataclass(slots=True)
class ProcessConfig:
    """workers: number of processes; null: as many as this process may use cores."""

    workers: int | None = None

    def __post_init__(self) -> None:
        if self.workers is not None:
            require("executor.workers", self.workers, at_least=1)


class ProcessExecutor:
    """Runs items in worker processes, each of which asks for the next as soon as it is free."""

    Config = ProcessConfig

    def __init__(self, config: ProcessConfig) -> None:
        self._config = config

    @property
    def workers(self) -> int:
        """Number of worker processes at most."""
        return self._config.workers or available_cores()

    def map(self, initialise: Initialise, payload: Any, items: Iterable[Item]) -> Iterator[Any]:
        """Results of `initialise(payload)` on every item, as they finish.

        initialise: a function at the top of a module, payload: anything that pickles. Raises what a worker
        raised: InputError as it is, anything else as EpisodeError, both naming the world and run;
        WorkerDiedError when a worker was killed. Leaving the iteration early stops the workers.
        """
        todo = list(items)
        if todo:
            with self.open(initialise, payload, len(todo)) as run_all:
                yield from run_all(todo)

    @contextlib.contextmanager
    def open(self, initialise: Initialise, payload: Any, at_once: int | None = None) -> Iterator[Map]:
        """The same for list after list of items; the workers live until the end of the `with`.

        at_once: the longest list, where it is known: no more workers than that are started.
        """
        workers: dict[Connection, BaseProcess] = {}
        count = self.workers if at_once is None else min(self.workers, at_once)
        try:
            _start_workers(workers, count, initialise, payload)
            yield lambda items: _hand_out(workers, items)
        finally:
            _stop(workers)


def available_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _hand_out(workers: dict[Connection, BaseProcess], items: Iterable[Item]) -> Iterator[Any]:
    """One item at a time to each worker: an episode takes far longer than the hand-over."""
    waiting = iter(items)
    busy: dict[Connection, Item] = {}

    def hand_next(worker: Connection) -> None:
        item = next(waiting, None)
        if item is not None:
            busy[worker] = item
            # A worker that is gone already is found out about when its answer is read.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                worker.send(item)

    for worker in workers:
        hand_next(worker)
    while busy:
        for worker in connection.wait(list(busy)):
            result = _receive(worker, workers[worker], busy.pop(worker))
            hand_next(worker)
            yield result


def _receive(worker: Connection, process: BaseProcess, item: Item) -> Any:
    try:
        error, result = worker.recv()
    except (EOFError, ConnectionResetError):
        process.join(_JOIN_S)
        raise WorkerDiedError(
            f"the worker on {item} died ({_cause(process.exitcode)}): finished episodes are kept; "
            "add resume=true, with fewer executor.workers if memory ran out"
        ) from None
    if error is not None:
        raise error
    return result


def _start_workers(
    workers: dict[Connection, BaseProcess], count: int, initialise: Initialise, payload: Any
) -> None:
    """Fill `workers` with the connection to, and the process of, each worker."""
    # Never fork: threads of this process (MLflow's) may hold locks that the child would wait for forever.
    with_server = "forkserver" in get_all_start_methods()
    context: Any = get_context("forkserver" if with_server else "spawn")
    with _environment(_ONE_THREAD):
        if with_server:
            # What all workers need is imported once, by the server that they are forked from.
            context.set_forkserver_preload([initialise.__module__])
            with _sigint_ignored():
                forkserver.ensure_running()
        for _ in range(count):
            ours, theirs = context.Pipe()
            process = context.Process(target=_work, args=(theirs, initialise, payload), daemon=True)
            process.start()
            theirs.close()
            workers[ours] = process


def _stop(workers: dict[Connection, BaseProcess]) -> None:
    """At once: a worker holds nothing that needs an orderly end."""
    for worker, process in workers.items():
        worker.close()
        process.terminate()
    for process in workers.values():
        process.join(_JOIN_S)


def _work(coordinator: Connection, initialise: Initialise, payload: Any) -> None:
    """A worker's life: build, then answer items until the coordinator hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The coordinator has built the same config and has warned of it; once is enough.
    warnings.simplefilter("ignore", UserWarning)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        try:
            run = initialise(payload)
        except Exception as error:
            coordinator.recv()
            coordinator.send((_portable(error, None), None))
            return
        while True:
            item = coordinator.recv()
            try:
                answer = None, run(item)
            except Exception as error:
                answer = _portable(error, item), None
            coordinator.send(answer)


def _portable(error: Exception, item: Item | None) -> Exception:
    """What the coordinator raises: an InputError stays one, anything else brings its traceback as text."""
    where = "" if item is None else f"{item}: "
    if isinstance(error, InputError):
        return InputError(f"{where}{error}")
    return EpisodeError(f"{where}{type(error).__name__}: {error}\n{traceback.format_exc()}")


def _cause(exit_code: int | None) -> str:
    if exit_code is None or exit_code >= 0:
        return f"exit code {exit_code}"
    return signal.Signals(-exit_code).name


@contextlib.contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    """Children started meanwhile inherit these."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _sigint_ignored() -> Iterator[None]:
    """A fork server started meanwhile ignores Ctrl-C, and so do its workers from birth: the coordinator stops
    them, without tracebacks of theirs.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
