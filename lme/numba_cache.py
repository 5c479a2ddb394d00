"""Where Numba keeps compiled kernels when the package's own folders cannot be written, as in a container."""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path

_VARIABLE = "NUMBA_CACHE_DIR"
_NAME = "lme-nav"
_PACKAGE = Path(__file__).resolve().parent


def choose(package: Path = _PACKAGE) -> None:
    """Set NUMBA_CACHE_DIR to a folder of the user's, unless it is set or `package` can be written.

    Numba reads the variable when it is imported, so this comes first. Worker processes inherit it.
    """
    if os.environ.get(_VARIABLE) or _writable(package):
        return
    for prepare in (_user_folder, _private_folder):
        with suppress(OSError, RuntimeError):  # RuntimeError: this user has no home
            os.environ[_VARIABLE] = str(prepare())
            return


def folder(source: Path) -> Path:
    """Where Numba keeps the kernels of a source file: beside it, or in NUMBA_CACHE_DIR under the name of its folder."""
    chosen = os.environ.get(_VARIABLE)
    if not chosen:
        return source.parent / "__pycache__"
    return Path(chosen) / f"{source.parent.name}_{hashlib.sha1(str(source.parent).encode()).hexdigest()}"


def _writable(package: Path) -> bool:
    """Whether Numba can write beside every module: in `__pycache__`, or where it has to be made."""
    folders = {path.parent for path in package.rglob("*.py")}
    caches = [folder / "__pycache__" for folder in folders]
    return all(os.access(cache if cache.is_dir() else cache.parent, os.W_OK) for cache in caches)


def _user_folder() -> Path:
    """`lme-nav` in the user's folder of caches. Raises OSError where it cannot be written."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    folder = (Path(base) if Path(base).is_absolute() else Path.home() / ".cache") / _NAME
    folder.mkdir(parents=True, exist_ok=True)
    tempfile.TemporaryFile(dir=folder).close()
    return folder


def _private_folder() -> Path:
    """A folder among the temporary files that only this user can write.

    Numba unpickles what it finds in its cache, so a folder that others could have filled is not used.
    """
    folder = Path(tempfile.gettempdir()) / f"{_NAME}-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    ours = status.st_uid == os.getuid() and not status.st_mode & 0o077 and not folder.is_symlink()
    return folder if ours else Path(tempfile.mkdtemp(prefix=f"{_NAME}-"))
