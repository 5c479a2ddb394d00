"""Process that worker processes are forked from: it imports what they need once, while the command starts."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from multiprocessing import forkserver, get_all_start_methods, get_context, resource_tracker
from types import ModuleType
from typing import Any

from runners.workers.environment import SAFE_PATH, environment
from runners.workers.signals import sigint_ignored, sigterm_blocked

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
