"""Heartbeats of running trials in a database: from their absence, other processes see that one was killed."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TYPE_CHECKING

from runners.search.optuna_private import id_of

if TYPE_CHECKING:
    import optuna
    from optuna.storages import RDBStorage


class Heartbeat:
    """The heartbeats of this process's trials. storage: None if it does not store any (a journal).

    Optuna sends them only from `Study.optimize`, which runs one trial at a time. `RDBStorage.record_heartbeat` is
    public, and so is `fail_stale_trials`.
    """

    def __init__(self, storage: RDBStorage | None) -> None:
        self._storage = storage
        self._running: set[int] = set()
        self._seen: set[int] = set()

    @property
    def finds_killed(self) -> bool:
        """Whether the trials of killed processes are found."""
        return self._storage is not None

    def begin(self, trial_id: int) -> None:
        """Start the heartbeat of a trial that this process runs."""
        if self._storage is not None:
            self._storage.record_heartbeat(trial_id)
            self._seen.add(trial_id)
            self._running.add(trial_id)

    def end(self, trial_id: int) -> None:
        """Stop the heartbeat of a trial."""
        self._running.discard(trial_id)

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
            # Its process may have been killed before the first heartbeat, and Optuna only misses a trial that had one.
            if id_of(trial) not in self._seen:
                self._storage.record_heartbeat(id_of(trial))
                self._seen.add(id_of(trial))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Optuna's warning that it is experimental
            fail_stale_trials(study)

    def _beat(self, storage: RDBStorage, stop: Event) -> None:
        interval = storage.get_heartbeat_interval()
        while not stop.wait(interval):
            for trial_id in tuple(self._running):
                with suppress(Exception):  # if the storage does not answer, the search itself reports it
                    storage.record_heartbeat(trial_id)
