"""Compiled kernels where the package's own folders cannot be written."""

import errno
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from lme import numba_cache
from tests.places import ROOT

NOBODY = 65534
COMPILE = """
import numpy as np
import lme
from lme.geometry.motion import travelled
assert lme.__file__.startswith({copy!r})
print(travelled(0.0, 0.0, np.ones((2, 3))), sum(travelled.stats.cache_hits.values()), travelled.stats.cache_path)
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of one module; no variable set, and folders of the user's and for temporary files."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    for folder in ("package/kernels", "temporary"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "package" / "kernels" / "motion.py").touch()
    return tmp_path / "package"


@pytest.fixture
def read_only(package, monkeypatch):
    """The same, and it cannot be written: permissions do not bind root, so the question is answered."""
    monkeypatch.setattr(numba_cache.os, "access", lambda path, mode: not Path(path).is_relative_to(package))
    return package


def chosen(package):
    """The folder for the package's kernels, which is there, and the place that it lies in."""
    numba_cache.choose(package)
    folder = Path(os.environ["NUMBA_CACHE_DIR"])
    assert folder.is_dir()
    return folder, folder.parent


def test_a_package_that_can_be_written_keeps_its_own_cache(package):
    assert chosen(package)[1] == package / "__pycache__"
    assert not (package.parent / "home").exists()


def test_a_read_only_package_has_a_cache_in_the_users_home(read_only):
    assert chosen(read_only)[1] == read_only.parent / "home" / ".cache" / "lme-nav"


def test_the_users_cache_folder_counts_where_it_is_absolute(read_only, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(read_only.parent / "caches"))
    assert chosen(read_only)[1] == read_only.parent / "caches" / "lme-nav"
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "caches")
    assert chosen(read_only)[1] == read_only.parent / "home" / ".cache" / "lme-nav"


def test_the_place_that_the_user_has_set_counts(package, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(package.parent / "mine"))
    assert chosen(package)[1] == package.parent / "mine"
    assert chosen(package)[1] == package.parent / "mine"  # in a process that this one starts


def test_a_place_of_the_users_that_cannot_be_written_stays(package, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", os.devnull)
    numba_cache.choose(package)
    assert os.environ["NUMBA_CACHE_DIR"] == os.devnull


def test_without_a_home_the_cache_is_a_private_temporary_folder(read_only, monkeypatch):
    monkeypatch.setenv("HOME", os.devnull)
    folder, place = chosen(read_only)
    assert place == read_only.parent / "temporary" / f"lme-nav-{os.getuid()}"
    assert place.stat().st_mode & 0o777 == 0o700
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    assert chosen(read_only)[0] == folder  # and the next process finds what was compiled


@pytest.mark.parametrize("trap", ["open", "link"])
def test_a_temporary_folder_that_others_could_have_filled_is_not_used(read_only, monkeypatch, trap):
    monkeypatch.setenv("HOME", os.devnull)
    trapped = read_only.parent / "temporary" / f"lme-nav-{os.getuid()}"
    if trap == "open":
        trapped.mkdir()
        trapped.chmod(0o777)
    else:
        trapped.symlink_to(read_only, target_is_directory=True)
    _, place = chosen(read_only)
    assert place != trapped
    assert place.parent == trapped.parent
    assert place.stat().st_mode & 0o777 == 0o700


def test_each_version_of_a_kernel_has_a_folder_and_the_newest_are_kept(package):
    source, folders = package / "kernels" / "motion.py", []
    for number in range(5):
        source.write_text(f"@njit\ndef travelled(): return {number}\n")
        folders.append(chosen(package)[0])
        os.utime(folders[-1], (number, number))
    assert len(set(folders)) == 5
    assert [folder.is_dir() for folder in folders] == [False, False, True, True, True]
    (package / "errors.py").write_text("no kernel")
    assert chosen(package)[0] == folders[-1]


CALLER = """
from numba import njit
import lme
from lme.geometry.{name} import {name}

@njit(cache=True)
def caller():
    return {name}()
"""
CALLED = """
from numba import njit

@njit(cache=True)
def called():
    return {value}
"""


def test_a_kernel_follows_a_change_of_a_kernel_that_it_calls(tmp_path):
    """Numba alone would keep using the old one, because the caller's own file is the same."""
    copy = tmp_path / "lme"
    shutil.copytree(ROOT / "lme", copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "geometry" / "caller.py").write_text(CALLER.format(name="called"))
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": ""}
    environment["PYTHONDONTWRITEBYTECODE"] = (
        "1"  # Python's own files of bytecode know times to the second only
    )
    command = [sys.executable, "-c", "from lme.geometry.caller import caller; print(caller())"]
    for value in ("1", "2"):
        (copy / "geometry" / "called.py").write_text(CALLED.format(value=value))
        done = subprocess.run(
            command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300
        )
        assert done.stdout == f"{value}\n", done.stderr


@pytest.fixture
def installed():
    """A copy of `lme` that an unprivileged user cannot write, the command that runs as one, and a folder of theirs."""
    # Not tmp_path, which is closed to others.
    place = Path(tempfile.mkdtemp(prefix="lme-read-only-"))
    place.chmod(0o755)
    shutil.copytree(ROOT / "lme", place / "lme", ignore=shutil.ignore_patterns("__pycache__"))
    (place / "mine").mkdir()
    command = [sys.executable]
    if os.geteuid() == 0:
        if shutil.which("setpriv") is None:
            pytest.skip("needs setpriv to run as an unprivileged user")
        command = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups", *command]
        os.chown(place / "mine", NOBODY, NOBODY)
    for folder in [place / "lme", *(path for path in (place / "lme").rglob("*") if path.is_dir())]:
        folder.chmod(0o555)
    if subprocess.run([*command, "-c", "import numba"], capture_output=True, cwd="/").returncode:
        pytest.skip(f"an unprivileged user cannot run {sys.executable}")
    yield place, command
    for folder in [place / "lme", *(path for path in (place / "lme").rglob("*") if path.is_dir())]:
        folder.chmod(0o755)
    shutil.rmtree(place)


def test_a_read_only_installation_compiles_once_for_a_user_without_a_home(installed):
    place, command = installed
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": str(place),
        "HOME": os.devnull,
        "TMPDIR": str(place / "mine"),
    }
    command = [*command, "-c", COMPILE.format(copy=str(place))]
    for hits in (0, 1):
        done = subprocess.run(command, env=environment, cwd="/", capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        length, found, path = done.stdout.split()
        assert float(length) == pytest.approx(2**0.5)
        assert int(found) == hits
        assert Path(path).is_relative_to(place / "mine")


class Files:
    """Stands in for Numba's class of a kernel's two files."""

    _cache_path = "kernels"

    def __init__(self, answer=None, error=None):
        self._answer, self._error = answer, error

    def _load(self, *_):
        if self._error is not None:
            raise self._error
        return self._answer

    _load_index = _load_data = save = _load


@pytest.fixture
def mended():
    class Mended(Files):
        pass

    numba_cache._note_damaged.cache_clear()
    numba_cache._note_not_kept.cache_clear()
    numba_cache._mend(Mended)
    return Mended


def test_numbas_class_has_what_is_mended_and_is_mended():
    from numba.core.caching import IndexDataCacheFile

    assert IndexDataCacheFile.lme_mended
    assert {"_load_index", "_load_data", "save"} <= set(vars(IndexDataCacheFile))


@pytest.mark.parametrize(
    "broken", [{"error": EOFError()}, {"error": pickle.UnpicklingError()}, {"answer": 3}]
)
def test_a_damaged_kernel_is_compiled_anew_with_a_note(mended, broken, says):
    with says.warns():
        assert mended(**broken)._load_index() == {}
    with pytest.raises(OSError, match="is damaged"):  # to Numba: the file is not there
        mended(**broken)._load_data("x.nbc")


def test_a_kernel_that_is_whole_or_not_there_is_left_to_numba(mended):
    assert mended(answer={"key": "x.nbc"})._load_index() == {"key": "x.nbc"}
    assert mended(answer=(1, 2))._load_data("x.nbc") == (1, 2)
    with pytest.raises(FileNotFoundError):
        mended(error=FileNotFoundError())._load_data("x.nbc")


def test_a_kernel_that_cannot_be_kept_is_used_with_a_note(mended, says):
    with says.warns():
        mended(error=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))).save("key", "data")
