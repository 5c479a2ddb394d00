"""Code that runs in a worker process of a dask cluster."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from distributed import Worker, WorkerPlugin, get_worker

from lme.errors import InputError
from runners.records.launch_record import versions
from runners.workers.executor import Item, Run, to_portable_error


class WorkerSetup(WorkerPlugin):
    """Setup shared by all items of an open executor. Dask keeps it in each worker, and gives it to new workers.

    pickled: `initialise` and its payload. required_versions: those of the process that hands out the items.
    """

    def __init__(self, token: str, pickled: bytes, required_versions: Mapping[str, str]) -> None:
        self.name = token
        self._pickled, self._required_versions = pickled, required_versions
        self._run: Run | None = None

    def run(self, items: Sequence[Item]) -> tuple[list[Any], Exception | None]:
        """Return the results of the items up to the first that fails, and its error."""
        results: list[Any] = []
        item: Item | None = None
        try:
            # The coordinator built the same config and printed the same warnings.
            with warnings.catch_warnings(action="ignore", category=UserWarning):
                run = self._build_once(get_worker())
                for item in items:
                    results.append(run(item))
        except (Exception, SystemExit) as error:
            return results, to_portable_error(error, item)
        return results, None

    def _build_once(self, worker: Worker) -> Run:
        """Return the function that runs one item; it is built when the first item comes."""
        if self._run is None:
            _check(worker, self._required_versions)
            initialise, payload = pickle.loads(self._pickled)
            self._run = initialise(payload)
        assert self._run is not None
        return self._run


def run_batch(items: Sequence[Item], token: str) -> tuple[list[Any], Exception | None]:
    """Run one task: items with the setup that the worker holds under `token`."""
    job = get_worker().plugins[token]
    assert isinstance(job, WorkerSetup)
    return job.run(items)


def _check(worker: Worker, required: Mapping[str, str]) -> None:
    """Raise InputError unless the worker gives the same results and runs one item at a time."""
    if worker.state.nthreads != 1:
        raise InputError(
            f"executor.address: the worker {worker.address} has {worker.state.nthreads} threads: "
            "must have one; start it with --nthreads 1"
        )
    installed = versions(*required)
    differing = [name for name in required if installed.get(name) != required[name]]
    if differing:
        has = ", ".join(f"{name} {installed.get(name, 'is missing')}" for name in differing)
        must = ", ".join(f"{name} {required[name]}" for name in differing)
        raise InputError(
            f"executor.address: the worker {worker.address} has {has}: must have {must}, as here"
        )
