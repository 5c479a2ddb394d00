"""What ends the processes of a command: signals that only the coordinator must handle, and its own end."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Iterator
from multiprocessing import parent_process

_LOOK_S = 1.0  # between looks at whether the parent is alive


@contextlib.contextmanager
def sigint_ignored() -> Iterator[None]:
    """Processes started in the block, and those that they start, ignore Ctrl-C: the coordinator stops them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def sigterm_blocked() -> Iterator[None]:
    """Processes started in the block ignore SIGTERM; this one handles at the end a SIGTERM that came meanwhile."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """End this process, even in the middle of an episode, when the process that started it has ended."""
    threading.Thread(target=_end_with_parent, args=(os.getppid(),), name="parent", daemon=True).start()


def _end_with_parent(number: int) -> None:
    """number: of the process above this one: the parent, or a server of processes that ends with it."""
    parent = parent_process()
    if parent is not None:
        parent.join()  # returns as soon as the parent's end of a pipe is closed
    while parent is None and os.getppid() == number:
        time.sleep(_LOOK_S)
    os._exit(1)
