"""What guards every command: how Ctrl-C and SIGTERM end it, and control codes that are shown instead of executed.

Slurm sends SIGTERM before it kills; only the exit status tells it from Ctrl-C. Control codes may come from a run that
is somebody else's.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any, TextIO

from runners.config.escaping import visible

_KEPT = "\n\t"  # control codes that stay


class Terminated(KeyboardInterrupt):
    """SIGTERM was received. It ends a command in the same order as Ctrl-C."""


def status_of(interrupt: KeyboardInterrupt) -> int:
    """Return the exit status: 128 plus the number of the signal."""
    return 128 + (signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT)


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Raise Terminated in the block at the first SIGTERM; later signals are ignored."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous_handler = signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous_handler)


def _terminate(number: int, frame: FrameType | None) -> None:
    signal.signal(number, signal.SIG_IGN)
    raise Terminated


@contextlib.contextmanager
def plain_output() -> Iterator[None]:
    """Make control codes visible in what the block prints on standard output and standard error."""
    original_streams = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_Plain(stream) if stream is not None else stream for stream in original_streams)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = original_streams


class _Plain:
    """A text stream that shows control codes.

    Rich gets clean text, colours it, and writes to the stream behind this one.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.rich_proxied_file = stream

    def write(self, text: str) -> int:
        self._stream.write(visible(text, _KEPT))
        return len(text)

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
