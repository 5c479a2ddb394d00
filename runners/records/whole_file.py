"""Atomic writes: a reader finds the old file or the new one, never a part of it."""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
STALE_S = 60.0  # a draft untouched for this long belongs to a process that was killed
_HOST = socket.gethostname()


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the path of a draft to write. When the `with` ends, the draft replaces `path`.

    The draft has the suffix of `path` and is in the same folder. If an exception ends the `with`, the draft is removed
    and `path` stays as it was. An OSError about the draft names `path` instead.
    """
    # Host and process are part of the name because two processes may write the same file at the same time.
    draft = path.with_name(f".{path.name}.{_HOST}.{os.getpid()}.new{path.suffix}")
    _remove_stale_drafts(path)
    try:
        yield draft
        draft.replace(path)
    except OSError as error:
        if str(error.filename or draft) != str(draft):
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()


def write_atomically(path: Path, text: str) -> None:
    """Write a text file atomically, in UTF-8. Raises OSError."""
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8")


def obstacle(path: Path) -> Path | None:
    """What prevents writing a file: itself, or the nearest folder above it that exists; None if nothing does."""
    nearest = next(folder for folder in path.absolute().parents if os.access(folder, os.F_OK))
    if not (nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)):
        return nearest
    return path if os.access(path, os.F_OK) and not os.access(path, os.W_OK) else None


def _remove_stale_drafts(path: Path) -> None:
    """Remove drafts of killed processes: on this machine those not running, from other machines the old ones."""
    for draft in path.parent.glob(f".{glob.escape(path.name)}.*.new{glob.escape(path.suffix)}"):
        with contextlib.suppress(OSError):  # another process may have removed it
            writer = draft.name.removeprefix(f".{path.name}.{_HOST}.").partition(".")[0]
            ended = writer.isdecimal() and not _is_running(int(writer))
            if ended or time.time() - draft.stat().st_mtime > STALE_S:
                draft.unlink()


def _is_running(process: int) -> bool:
    """Whether a process of this machine is running."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True
