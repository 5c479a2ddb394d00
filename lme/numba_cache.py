"""Where Numba keeps compiled kernels: in a folder for each version of their sources.

Numba compiles what a kernel calls into it, but notices only changes of the file that holds the kernel itself. After
an update it would keep running old code, or crash. So a change of any source starts a new folder.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_VARIABLE = "NUMBA_CACHE_DIR"
_NAME = "lme-nav"
_PACKAGE = Path(__file__).resolve().parent
_PREFIX = "kernels-"
_KEPT = 3  # versions: a checkout may switch back and forth between some


def choose(package: Path = _PACKAGE) -> None:
    """Set NUMBA_CACHE_DIR to a folder for the current sources: in the one it names, in `package`, or the user's.

    Numba reads the variable when it is imported, so this comes first. Worker processes inherit it.
    """
    for base in _candidates(package):
        folder = base / f"{_PREFIX}{_version(package)}"
        with suppress(OSError):
            is_new = not folder.is_dir()
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.environ[_VARIABLE] = str(folder)
            if "numba" in sys.modules:
                sys.modules["numba"].config.CACHE_DIR = str(folder)
            if is_new:
                _remove_old(base)
            return


def folder(source: Path) -> Path:
    """Where Numba keeps the kernels of a source file: in NUMBA_CACHE_DIR under the name of its folder."""
    chosen = os.environ.get(_VARIABLE)
    if not chosen:
        return source.parent / "__pycache__"
    return Path(chosen) / f"{source.parent.name}_{hashlib.sha1(str(source.parent).encode()).hexdigest()}"


def _version(package: Path) -> str:
    """A name for the current sources of all kernels."""
    known = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"njit" in source:
            known.update(str(path.relative_to(package)).encode() + b"\0" + source)
    return known.hexdigest()[:16]


def _candidates(package: Path) -> Iterator[Path]:
    """The possible places of the folder, best first. If NUMBA_CACHE_DIR is set, it is the only one."""
    given = os.environ.get(_VARIABLE)
    if given:
        # A process that has called `choose` hands its own folder to those that it starts.
        yield Path(given).parent if Path(given).name.startswith(_PREFIX) else Path(given)
        return
    if os.access(package, os.W_OK):
        yield package / "__pycache__"
    with suppress(RuntimeError):  # this user has no home directory
        base = os.environ.get("XDG_CACHE_HOME", "")
        yield (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / _NAME
    with suppress(OSError):
        yield _private_folder()


def _private_folder() -> Path:
    """A temporary folder that only this user can write.

    Numba unpickles what it finds in its cache, so a folder that others could have filled is not used.
    """
    folder = Path(tempfile.gettempdir()) / f"{_NAME}-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    ours = status.st_uid == os.getuid() and not status.st_mode & 0o077 and not folder.is_symlink()
    return folder if ours else Path(tempfile.mkdtemp(prefix=f"{_NAME}-"))


def _remove_old(base: Path) -> None:
    """Remove the folders of earlier sources, except the newest."""
    folders = sorted(base.glob(f"{_PREFIX}*"), key=lambda path: path.stat().st_mtime)
    for old in folders[:-_KEPT]:
        shutil.rmtree(old, ignore_errors=True)
