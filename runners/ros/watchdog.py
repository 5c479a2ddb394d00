"""A watchdog that stops the robot while the loop that should drive it is blocked."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self


class Watchdog:
    """Context manager that calls `halt`, from its own thread, if `feed` was not called for `patience` [s]."""

    def __init__(self, patience: float, halt: Callable[[], None]) -> None:
        self._patience, self._halt = patience, halt
        self._fed = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended = True
        self._fed.set()
        self._thread.join()

    def feed(self) -> None:
        """Report that the loop is running."""
        self._fed.set()

    def _watch(self) -> None:
        while not self._ended:
            if not self._fed.wait(self._patience):
                self._halt()
            self._fed.clear()
