"""Guards around every command: signals, errors with a cause outside the program, and control codes in its output.

Slurm sends SIGTERM before it kills; only the exit status tells it from Ctrl-C. Control codes may come from a run that
is somebody else's.
"""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any, TextIO

from runners.config.escaping import visible
from runners.records.atomic_write import what_is_full

_KEPT = "\n\t"  # control codes that stay
_NO_TEMPORARY = "No usable temporary directory"  # the message of Python's tempfile
_FORBIDDEN = (errno.EROFS, errno.EACCES, errno.EPERM)
# Packages that `pip install ./lme`, the robots' installation, leaves out, by the module that is imported.
PACKAGES = {
    "hydra": "hydra-core",
    "jinja2": "jinja2",
    "matplotlib": "matplotlib",
    "mlflow": "mlflow",
    "onnx": "onnx",
    "onnxruntime": "onnxruntime",
    "optuna": "optuna",
    "packaging": "packaging",
    "pandas": "pandas",
    "pyarrow": "pyarrow",
    "rich": "rich",
}


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


def explain_os_error(error: BaseException) -> str:
    """Return the message for a full disk, for temporary folders, for a deleted folder, or for a forbidden path.

    Empty for any other error.
    """
    if not isinstance(error, OSError):
        return ""
    # Full disks and quotas first: they can happen to any file.
    full_disk = what_is_full(error, error.filename or "a file")
    if full_disk:
        return f"{full_disk}: finished work is kept; free some space and add resume=true"
    if error.errno == errno.ENOENT and _NO_TEMPORARY in str(error.strerror):
        directories = str(error.strerror).partition("[")[2].rstrip("]")
        return (
            f"no temporary file can be written in {directories}: free some space there, set TMPDIR to "
            "a folder that can be written, or raise ulimit -f"
        )
    if error.errno == errno.ENOENT and error.filename and not Path(str(error.filename)).parent.exists():
        return f"{error.filename}: its folder is gone: it was deleted while lme was using it; start again"
    if error.errno in _FORBIDDEN and error.filename:
        return (
            f"{error.filename}: cannot be used ({error.strerror}): finished work is kept; use another folder"
        )
    return ""


def explain_missing(error: ModuleNotFoundError, command: str) -> str:
    """Return what is missing and how to install it; empty for a module that every installation has, or for none."""
    package = PACKAGES.get((error.name or "").partition(".")[0])
    if package is None:
        return ""
    install = "pip install './lme[live]'" if command == "live" else "pip install --editable ."
    return f"needs {package}, which is not installed; {install} in a checkout of lme installs what lme {command} needs"


@contextlib.contextmanager
def starting(name: str) -> Iterator[None]:
    """Show on a terminal that a command is being imported, which takes a second, and longer on a busy machine."""
    stream = getattr(sys.stderr, "rich_proxied_file", sys.stderr)  # not the guard, which shows control codes
    is_shown = stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"
    if is_shown:
        print(f"lme {name} starts", end="", file=stream, flush=True)
    try:
        yield
    finally:
        if is_shown:
            print("\r\x1b[K", end="", file=stream, flush=True)
