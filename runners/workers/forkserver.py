"""Process that worker processes are forked from: it imports what they need once, while the command starts.

Of the signals that end a command, the coordinator alone handles them; its workers end with it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing import forkserver, get_all_start_methods, get_context, parent_process, resource_tracker
from types import ModuleType
from typing import Any

from runners.workers.environment import SAFE_PATH, environment

# One thread per worker: the workers are the parallelism.
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
# Modules that most jobs need; a worker imports the others itself.
_PRELOAD = (
    "runners.workers.episodes",
    "runners.workers.trials",
    "lme.guides.lme.guide",
    "lme.planners.simple",
    "lme.simulation.fast",
    "lme.worlds.barn.map_set",
)
# Never fork: threads of this process (MLflow's) may hold locks that the child would wait for forever.
_METHOD = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"
_LOOK_S = 1.0  # [s] between checks of whether the parent is alive


def start() -> None:
    """Start the server if this system has one and it is not running. Returns at once, while the server imports.

    It and the processes that it forks block SIGTERM.
    """
    if _METHOD == "forkserver":
        get_context(_METHOD).set_forkserver_preload(list(_PRELOAD))
        with environment({**ONE_THREAD, **SAFE_PATH}):
            resource_tracker.ensure_running()  # first, because its start leaves SIGTERM unblocked
            with sigint_ignored(), sigterm_blocked():
                forkserver.ensure_running()


@contextlib.contextmanager
def context() -> Iterator[Any]:
    """Give the `multiprocessing` context that starts workers, with the environment that they need."""
    start()
    with environment({**ONE_THREAD, **SAFE_PATH}), _without_main():
        yield get_context(_METHOD)


@contextlib.contextmanager
def _without_main() -> Iterator[None]:
    """Hide the main script: a worker does not need it, and would run it again to import it."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


@contextlib.contextmanager
def sigint_ignored() -> Iterator[None]:
    """Let processes started in the block, and those that they start, ignore Ctrl-C: the coordinator stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous_handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous_handler)


@contextlib.contextmanager
def sigterm_blocked() -> Iterator[None]:
    """Let processes started in the block ignore SIGTERM; this process handles one that came meanwhile at the end."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


def end_with_parent() -> None:
    """End this process, even in the middle of an episode, when the process that started it has ended."""
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), name="parent", daemon=True).start()


def _end_with_parent(number: int) -> None:
    """Wait for the end. number: id of the process above, the parent or a fork server that ends with the parent."""
    parent = parent_process()
    if parent is not None:
        parent.join()  # returns as soon as the parent's end of a pipe is closed
    while parent is None and os.getppid() == number:
        time.sleep(_LOOK_S)
    os._exit(1)
