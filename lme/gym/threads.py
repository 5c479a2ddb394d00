"""Threads that share the robots of a fleet. Kernels release the interpreter's lock, and robots do not touch each other.

A pool of Python threads, unlike Numba's own, survives a fork, so a process may use it and then start workers.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

import numba
import numpy as np

from lme.errors import InputError
from lme.types import Ints

_FEWEST = 16  # [robots] in a part: for fewer, calling the kernels takes as long as their step
_PARTS = 4  # for each thread


class Threads:
    """Runs kernels on parts of the robots. The results do not depend on the number of threads."""

    def __init__(self, threads: int | None) -> None:
        """threads: at most so many; None: one per core, but one in a worker process, whose cores are taken.

        NUMBA_NUM_THREADS limits what None means, as executors of joblib set it. Raises InputError below 1.
        """
        if threads is not None and threads < 1:
            raise InputError(f"threads is {threads}: must be at least 1, or None for one per core")
        is_worker = multiprocessing.parent_process() is not None
        self.count = threads or (1 if is_worker else int(numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]

    def run(self, work: Callable[[Ints], None], robots: Ints) -> None:
        """Call `work` with parts of the robots (K,), in this thread and in others at the same time.

        Each thread takes the next part when it is done with one, so a thread that gets no core delays nobody.
        """
        num_parts = min(_PARTS * self.count, len(robots) // _FEWEST)
        if self.count == 1 or num_parts <= 1:
            work(robots)
            return
        parts = iter(np.array_split(robots, num_parts))  # an iterator of a list: threads may share it

        def take() -> None:
            for part in parts:
                work(part)

        helpers = min(self.count, num_parts) - 1
        futures = [_pool(self.count, os.getpid()).submit(take) for _ in range(helpers)]
        take()
        for future in futures:
            if not future.cancel():
                future.result()


@lru_cache(maxsize=1)
def _pool(count: int, process: int) -> ThreadPoolExecutor:
    """Threads of this process beside the one that calls."""
    return ThreadPoolExecutor(count - 1, thread_name_prefix="lme-fleet")
