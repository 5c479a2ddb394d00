"""Atomic writes: a reader finds the old file or the new one, never a part of it.

A path that lme itself names in a run's directory is replaced, whatever it is: a link there may come from somebody
else. A path that the user names (`output_file`, `output_path`) is followed if it is a link.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import shutil
import socket
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from lme.errors import InputError

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
STALE_S = 60.0  # a draft untouched for this long belongs to a process that was killed
_HOST = socket.gethostname()
_LINKS = 40  # links in a row that Linux follows


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the path of a draft to write. When the `with` ends, the draft replaces `path`.

    The draft has the suffix of `path` and is in the same folder; the file keeps its permissions. If an exception ends
    the `with`, the draft is removed and `path` stays as it was. An OSError about the draft names `path` instead.
    """
    # Host and process are part of the name because two processes may write the same file at the same time.
    draft = path.with_name(f".{path.name}.{_HOST}.{os.getpid()}.new{path.suffix}")
    _remove_stale_drafts(path)
    try:
        yield draft
        _keep_mode(path, draft)
        draft.replace(path)
    except OSError as error:
        if str(error.filename or draft) != str(draft):
            raise
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        with contextlib.suppress(OSError):
            draft.unlink()


@contextlib.contextmanager
def output_file(path: Path) -> Iterator[Path]:
    """Yield the path of a draft to write, for a file, pipe or device that the user named.

    When the `with` ends, the draft replaces the file that `path` leads to, or is copied into a pipe or device such as
    /dev/stdout. If an exception ends the `with`, nothing is written. An OSError names `path`.
    """
    # A regular file is replaced atomically; errors name the path that the user gave.
    descriptor = _descriptor(path)
    if descriptor is None and not _is_special(path):
        target = _followed(path)
        try:
            with replacing(target) as draft:
                yield draft
        except OSError as error:
            if error.filename != str(target):
                raise
            raise OSError(error.errno, error.strerror, str(path)) from error
        return
    # A pipe, device or open descriptor gets the content once the draft is complete.
    with tempfile.TemporaryDirectory(prefix="lme-") as folder:
        draft = Path(folder) / f"draft{path.suffix}"
        yield draft
        sys.stdout.flush()
        destination = path if descriptor is None else os.dup(descriptor)
        with draft.open("rb") as source, open(destination, "wb") as sink:  # noqa: PTH123  # a path or a number
            shutil.copyfileobj(source, sink)


def output_path(path: Path, key: str) -> Path:
    """Return the file that a user's path leads to, for `replacing`: a link stays, and its target is replaced.

    Raises InputError for a file that may not be written, a pipe or a device. key: name under which it was given.
    """
    try:
        if _is_special(path):
            raise InputError(f"{key} {path}: is a pipe or a device: must be a file")
        return _followed(path)
    except OSError as error:
        raise InputError(f"{key} {path}: cannot be written ({error.strerror})") from error


def is_standard_output(path: Path) -> bool:
    """Return whether a path, such as /dev/stdout, leads to this process's standard output."""
    try:
        return os.path.samestat(path.stat(), os.fstat(sys.stdout.fileno()))
    except (OSError, ValueError):  # no such path, or a closed stream
        return False


def write_atomically(path: Path, text: str) -> None:
    """Write a text file atomically, in UTF-8. Raises OSError."""
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8")


def what_is_full(error: OSError, target: object) -> str:
    """Return "disk full while writing PLACE", and whether a limit may be the cause; empty for another error."""
    if error.errno not in DISK_FULL:
        return ""
    limit = " (or it is larger than ulimit -f allows)" if error.errno == errno.EFBIG else ""
    return f"disk full while writing {target}{limit}"


def obstacle(path: Path) -> Path | None:
    """Return the path that prevents writing a file: itself, or the nearest existing folder above it; None if none."""
    nearest = next(folder for folder in path.absolute().parents if os.access(folder, os.F_OK))
    if not (nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)):
        return nearest
    return path if os.access(path, os.F_OK) and not os.access(path, os.W_OK) else None


def _is_special(path: Path) -> bool:
    """Return whether a path leads to something that exists and is neither a file nor a folder. Raises OSError."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _followed(path: Path) -> Path:
    """Return the target of a path; it need not exist. Raises OSError for a read-only file or a folder."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    if target.is_file() and not os.access(target, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    return target


def _keep_mode(path: Path, draft: Path) -> None:
    """Give a draft the permissions of the file that it replaces, if there is one."""
    with contextlib.suppress(FileNotFoundError):
        mode = path.lstat().st_mode
        if stat.S_ISREG(mode):
            draft.chmod(stat.S_IMODE(mode))


def _descriptor(path: Path) -> int | None:
    """Return the open file of this process that a path such as /dev/fd/63 or /dev/stdout names; None for others."""
    for _ in range(_LINKS):
        folder = Path(os.path.realpath(path.parent))
        if folder == Path(f"/proc/{os.getpid()}/fd") and path.name.isdecimal():
            return int(path.name)
        if not path.is_symlink():
            break
        path = folder / path.readlink()
    return None


def _remove_stale_drafts(path: Path) -> None:
    """Remove drafts of killed processes: those of processes of this machine that do not run, and all old ones."""
    for draft in path.parent.glob(f".{glob.escape(path.name)}.*.new{glob.escape(path.suffix)}"):
        with contextlib.suppress(OSError):  # another process may have removed it
            writer = draft.name.removeprefix(f".{path.name}.{_HOST}.").partition(".")[0]
            has_ended = writer.isdecimal() and not _is_running(int(writer))
            if has_ended or time.time() - draft.stat().st_mtime > STALE_S:
                draft.unlink()


def _is_running(process: int) -> bool:
    """Return whether a process of this machine is running."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    return True
