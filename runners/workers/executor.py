"""Executors that run the episodes in this process or in worker processes, with the same results.

`initialise(payload)` builds what every episode needs, once per process, and returns the function that runs one
item. Results are yielded as they finish. `map` runs one list of items; `open` keeps the processes for several lists.

Pools of other libraries were tried with two workers and nine items, of which one kills its worker. loky's, like that
of `concurrent.futures`, then fails all items that have not finished, and does not tell which of them was at fault;
pebble's loses that item alone. But all three report an initialiser's error as a broken pool, so a mistake in a config
would not reach the user, and their workers outlive a killed parent. With pebble, this module would still have to hand
out items, carry errors over and end workers, and would be about as long as it is.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import itertools
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing import connection, parent_process
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any

from lme.errors import InputError, require
from lme.inputs.user_code import explained

Item = Any  # anything that pickles; messages name it by its str()
Run = Callable[[Item], Any]
Initialise = Callable[[Any], Run]
Map = Callable[[Iterable[Item]], Iterator[Any]]  # items to results, as they finish

_JOIN_S = 5.0


class EpisodeError(RuntimeError):
    """An episode failed for a reason other than a user's mistake. The message names its world and run.

    trace: the traceback, where a user's own code failed; otherwise it is in the message.
    """

    trace = ""


class WorkerDiedError(RuntimeError):
    """A worker process ended during an episode, because it was killed or memory ran out; or a cluster is gone."""


@dataclass(slots=True)
class SerialConfig:
    """Settings of the serial executor, which has none."""


class SerialExecutor:
    """Executor that runs all items in this process, one after the other, for debugging and profiling."""

    Config = SerialConfig

    def __init__(self, config: SerialConfig) -> None:
        self._config = config

    def map(self, initialise: Initialise, payload: Any, items: Iterable[Item]) -> Iterator[Any]:
        """Yield the result of `initialise(payload)` on every item, in order."""
        with self.open(initialise, payload) as run_all:
            yield from run_all(items)

    @contextlib.contextmanager
    def open(self, initialise: Initialise, payload: Any, at_once: int | None = None) -> Iterator[Map]:
        """Give a `map` for several lists of items; `initialise` is called once."""
        try:
            run = initialise(payload)
        except (Exception, SystemExit) as error:
            raise to_portable_error(error, None) from error

        def run_all(items: Iterable[Item]) -> Iterator[Any]:
            for item in items:
                try:
                    result = run(item)
                except (Exception, SystemExit) as error:  # a user's own planner may call `exit`
                    raise to_portable_error(error, item) from error
                yield result

        yield run_all


@dataclass(slots=True)
class ProcessConfig:
    """Settings of the process executor. workers: number of processes; null: one for each usable core."""

    workers: int | None

    def __post_init__(self) -> None:
        if self.workers is not None:
            require("workers", self.workers, at_least=1)


class ProcessExecutor:
    """Executor that runs items in worker processes; each gets the next item as soon as it is free.

    Inside a worker process of a Hydra launcher (joblib) it runs them there, one after the other: such a process
    may be unable to start others, and the launcher already runs as many jobs at once as there are cores.
    """

    Config = ProcessConfig

    def __init__(self, config: ProcessConfig) -> None:
        self._config = config

    @property
    def workers(self) -> int:
        """Largest number of worker processes."""
        return self._config.workers or available_cores()

    def map(self, initialise: Initialise, payload: Any, items: Iterable[Item]) -> Iterator[Any]:
        """Yield the result of `initialise(payload)` on every item, as they finish.

        initialise: a function at the top level of a module. payload: anything that pickles. Raises InputError and
        EpisodeError (any other exception of a worker), which name the world and run, and WorkerDiedError if a
        worker was killed. Leaving the iteration stops the workers.
        """
        return map_once(self.open, self.workers, initialise, payload, items)

    @contextlib.contextmanager
    def open(self, initialise: Initialise, payload: Any, at_once: int | None = None) -> Iterator[Map]:
        """Give a `map` for several lists of items; the workers live until the end of the `with`.

        at_once: length of the longest list, if known: no more workers than that are started.
        """
        serial = serial_in_launcher("process")
        if serial is not None:
            with serial.open(initialise, payload) as run_all:
                yield run_all
            return
        workers: dict[Connection, BaseProcess] = {}
        count = self.workers if at_once is None else min(self.workers, at_once)
        try:
            _start_workers(workers, count, initialise, payload)
            yield lambda items: _hand_out(workers, items)
        finally:
            _stop(workers)


def map_once(
    open_workers: Callable[[Initialise, Any, int], contextlib.AbstractContextManager[Map]],
    max_workers: int,
    initialise: Initialise,
    payload: Any,
    items: Iterable[Item],
) -> Iterator[Any]:
    """Yield the result of every item, as they finish, from workers that live as long as the iteration.

    max_workers: number of workers; no more are started than there are items.
    """
    remaining = iter(items)
    first_items = list(itertools.islice(remaining, max_workers))
    if first_items:
        with open_workers(initialise, payload, len(first_items)) as run_all:
            yield from run_all(itertools.chain(first_items, remaining))


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def serial_in_launcher(executor: str) -> SerialExecutor | None:
    """Return the executor to use instead of `executor` inside a launcher's worker process; None elsewhere."""
    if parent_process() is None:
        return None
    _announce_serial(executor)
    return SerialExecutor(SerialConfig())


@functools.cache  # printed once per process
def _announce_serial(executor: str) -> None:
    print(
        f"executor={executor}: inside a launcher's worker process, episodes run one by one", file=sys.stderr
    )


def _hand_out(workers: dict[Connection, BaseProcess], items: Iterable[Item]) -> Iterator[Any]:
    """Give each worker one item at a time: an episode takes far longer than sending an item."""
    remaining = iter(items)
    busy: dict[Connection, Item] = {}

    def hand_next(worker: Connection) -> None:
        item = next(remaining, None)
        if item is not None:
            busy[worker] = item
            # If the worker has died, `_receive` raises the error.
            with contextlib.suppress(BrokenPipeError, ConnectionResetError):
                worker.send(item)

    for worker in workers:
        hand_next(worker)
    while busy:
        ready = connection.wait(list(busy))
        for worker in [worker for worker in busy if worker in ready]:
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
    """Add each worker's connection and process to `workers`."""
    from runners.workers import forkserver

    with forkserver.context() as context:
        for _ in range(count):
            parent_end, child_end = context.Pipe()
            process = context.Process(target=_work, args=(child_end, initialise, payload), daemon=True)
            process.start()
            child_end.close()
            workers[parent_end] = process


def _stop(workers: dict[Connection, BaseProcess]) -> None:
    """Kill the workers at once: they do not hold anything that must be closed."""
    for worker, process in workers.items():
        worker.close()
        process.kill()
    for process in workers.values():
        process.join(_JOIN_S)


def _work(coordinator: Connection, initialise: Initialise, payload: Any) -> None:
    """Build once, then return results of items until the coordinator closes the connection or ends."""
    from runners.workers.forkserver import end_with_parent

    end_with_parent()
    # All processes receive these two; the coordinator ends the workers.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    # The coordinator built the same config and printed the same warnings.
    warnings.simplefilter("ignore", UserWarning)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        try:
            run = initialise(payload)
        except (Exception, SystemExit) as error:
            coordinator.recv()
            coordinator.send((to_portable_error(error, None), None))
            return
        gc.freeze()  # garbage collection skips what has been imported and built: it stays
        while True:
            item = coordinator.recv()
            answer: tuple[Exception | None, Any]
            try:
                answer = None, run(item)
            except (Exception, SystemExit) as error:
                answer = to_portable_error(error, item), None
            coordinator.send(answer)


def to_portable_error(error: BaseException, item: Item | None) -> Exception:
    """Return the error that the coordinator raises, which names the item.

    An InputError remains one. An error of a user's own code is explained in a line, any other carries its traceback.
    """
    prefix = "" if item is None else f"{item}: "
    if isinstance(error, InputError):
        return InputError(f"{prefix}{error}")
    explanation = explained(error)
    if not explanation:
        return EpisodeError(f"{prefix}{type(error).__name__}: {error}\n{traceback.format_exc()}")
    portable = EpisodeError(f"{prefix}{explanation}")
    portable.trace = traceback.format_exc()
    return portable


def _cause(exit_code: int | None) -> str:
    if exit_code is None or exit_code >= 0:
        return f"exit code {exit_code}"
    return signal.Signals(-exit_code).name
