"""End of a command's processes: signals that only the coordinator must handle, and the coordinator's own end."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from multiprocessing import parent_process

_LOOK_S = 1.0  # [s] between checks of whether the parent is alive


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
