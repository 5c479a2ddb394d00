"""What must not happen while an input is read: writing elsewhere, hanging, taking memory."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

SLOWEST_S = 10.0  # of processor time, so that a busy machine finds no faults; and six times that of wall time
_WAIT = 6.0
MEMORY_MB = 1024
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = (
    "os.rename", "os.remove", "os.rmdir", "os.mkdir", "os.truncate", "os.link", "os.symlink", "os.chmod", "os.chown",
    "shutil.rmtree", "shutil.move",
)  # fmt: skip
_NEVER = ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "socket.connect", "socket.bind")
_OWN = ("__pycache__", "/dev/null", "/dev/shm", "/proc/self")  # of Python, Numba and threads


class Hang(BaseException):
    """Reading took longer than SLOWEST_S, or waited."""


class Guard:
    """Notes every change outside of `allowed`. There is one in a process, which it stays in."""

    def __init__(self, allowed: Path) -> None:
        self._allowed = str(allowed.resolve())
        self.trespasses: list[str] = []
        sys.addaudithook(self._heard)
        signal.signal(signal.SIGALRM, _hang)
        signal.signal(signal.SIGPROF, _hang)

    def limit_memory(self) -> None:
        """Let the process have MEMORY_MB more than now. Call it after one good input."""
        most = _mapped_bytes() + MEMORY_MB * 2**20
        resource.setrlimit(resource.RLIMIT_AS, (most, most))

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Raise Hang in the block after SLOWEST_S; end the process if it does not hear that."""
        faulthandler.dump_traceback_later(2 * _WAIT * SLOWEST_S, exit=True)
        signal.setitimer(signal.ITIMER_REAL, _WAIT * SLOWEST_S)
        signal.setitimer(signal.ITIMER_PROF, SLOWEST_S)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            faulthandler.cancel_dump_traceback_later()

    def _heard(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode, flags = arguments
            if (isinstance(flags, int) and flags & _WRITES) or (
                isinstance(mode, str) and set(mode) & set("wax+")
            ):
                self._check(event, path)
        elif event in _CHANGES:
            for path in arguments[:2]:
                self._check(event, path)
        elif event in _NEVER:
            self.trespasses.append(f"{event} {arguments!r:.200}")

    def _check(self, event: str, path: Any) -> None:
        if not isinstance(path, str | bytes | os.PathLike):
            return
        place = os.path.abspath(os.fsdecode(path))  # noqa: PTH100  (a Path would resolve links, by more events)
        if not place.startswith(self._allowed) and not any(own in place for own in _OWN):
            self.trespasses.append(f"{event} {place}")


def _hang(number: int, _frame: Any) -> None:
    used = number == signal.SIGPROF
    raise Hang(
        f"longer than {SLOWEST_S if used else _WAIT * SLOWEST_S:g} s{' of processor time' if used else ''}"
    )


def _mapped_bytes() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def peak_mb() -> float:
    """The most memory that the process ever had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
