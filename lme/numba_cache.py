"""Location of Numba's compiled kernels: a folder for each version of their sources.

Numba compiles what a kernel calls into it, but notices only changes of the file that holds the kernel itself. After
an update it would therefore keep running old code, or crash. So a change of any source starts a new folder.

Numba also crashes on a damaged file of its cache, such as one that was being written when the disk filled up or the
machine went down. This module has such a kernel compiled and stored anew.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from lme.after_import import after_import

_VARIABLE = "NUMBA_CACHE_DIR"
_NAME = "lme-nav"
_PACKAGE = Path(__file__).resolve().parent
_PREFIX = "kernels-"
FIRST_STEP, _LAST_KERNEL = _PACKAGE / "geometry" / "motion.py", "travelled"  # see `compiled`
_NUMBA_CACHING = "numba.core.caching"  # its module that reads and writes the cache
_MAX_VERSIONS = 3  # versions that are kept, since a checkout may switch back and forth between some


def choose(package: Path = _PACKAGE) -> None:
    """Set NUMBA_CACHE_DIR to a folder for the current sources.

    The folder lies in the one that the variable names, else in `package`, else in the user's cache. Numba reads the
    variable when it is imported, so call this first. Worker processes inherit it.
    """
    # A damaged file of the cache is compiled anew, and one that cannot be written is done without.
    after_import(_NUMBA_CACHING, lambda module: _mend(module.IndexDataCacheFile))
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
    """Return Numba's folder for the kernels of a source file: in NUMBA_CACHE_DIR, named after the file's folder."""
    cache_dir = os.environ.get(_VARIABLE)
    if not cache_dir:
        return source.parent / "__pycache__"
    return Path(cache_dir) / f"{source.parent.name}_{hashlib.sha1(str(source.parent).encode()).hexdigest()}"


def compiled() -> bool:
    """Return whether the cache has the kernel that the first step of an episode calls last, for this version of Numba.

    Numba is not imported, which would take a second. The cache may still lack the kernels of a guide, planner or
    simulator that was never used.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return True
    name = f"{FIRST_STEP.stem}.{_LAST_KERNEL}-*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    indices = folder(FIRST_STEP).glob(name)
    return any(version("numba").encode() in index.read_bytes() for index in indices)


def _version(package: Path) -> str:
    """A name for the current sources of all kernels."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        if b"njit" in source:
            digest.update(str(path.relative_to(package)).encode() + b"\0" + source)
    return digest.hexdigest()[:16]


def _candidates(package: Path) -> Iterator[Path]:
    """The possible places of the folder, best first. If NUMBA_CACHE_DIR is set, it is the only one."""
    cache_dir = os.environ.get(_VARIABLE)
    if cache_dir:
        # A process that has called `choose` hands its own folder to those that it starts.
        yield Path(cache_dir).parent if Path(cache_dir).name.startswith(_PREFIX) else Path(cache_dir)
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
    is_private = status.st_uid == os.getuid() and not status.st_mode & 0o077 and not folder.is_symlink()
    return folder if is_private else Path(tempfile.mkdtemp(prefix=f"{_NAME}-"))


def _remove_old(base: Path) -> None:
    """Remove the folders of earlier sources, except the newest."""
    folders = sorted(base.glob(f"{_PREFIX}*"), key=lambda path: path.stat().st_mtime)
    for old in folders[:-_MAX_VERSIONS]:
        shutil.rmtree(old, ignore_errors=True)


def _mend(files: Any) -> None:
    """Make Numba's cache files survive damage.

    files: Numba's class of the two files of a kernel, an index by signature and the compiled code.
    """
    if hasattr(files, "lme_mended"):
        return
    load_index, load_data, save = files._load_index, files._load_data, files.save

    # A damaged index reads as an empty one, and damaged code as a missing file: Numba compiles in both cases.
    def _load_index(self: Any) -> Any:
        with suppress(Exception):  # a damaged pickle may raise anything
            index = load_index(self)
            if isinstance(index, dict):
                return index
        _note_damaged(self._cache_path)
        return {}

    def _load_data(self: Any, name: str) -> Any:
        try:
            code = load_data(self, name)
            if isinstance(code, tuple):
                return code
        except OSError:  # Numba takes this for a missing file, and compiles
            raise
        except Exception:
            pass
        _note_damaged(self._cache_path)
        raise OSError(f"{name} is damaged")

    # A kernel that cannot be saved still runs.
    def _save(self: Any, key: Any, data: Any) -> None:
        try:
            save(self, key, data)
        except OSError as error:
            _note_not_kept(self._cache_path, error.strerror or str(error))

    files._load_index, files._load_data, files.save = _load_index, _load_data, _save
    files.lme_mended = True


@cache  # warn once of a folder, though it holds many kernels
def _note_damaged(folder: str) -> None:
    warnings.warn(f"compiled kernels in {folder} are damaged: they are compiled anew", stacklevel=4)


@cache
def _note_not_kept(folder: str, reason: str) -> None:
    warnings.warn(
        f"compiled kernels cannot be kept in {folder} ({reason}): compiled again next time", stacklevel=4
    )
