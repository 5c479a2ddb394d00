"""Checks whether the kernels are already compiled; the first episode after installation waits for that."""

from __future__ import annotations

import hashlib
import os
import struct
import sys
from importlib.metadata import version
from pathlib import Path

import lme
from lme import numba_cache

SOURCE = Path(lme.__file__).parent / "kernels" / "motion.py"
_LAST = "travelled"  # the last kernel of it that the first step of an episode calls


def compiled() -> bool:
    """Whether Numba's cache has the current `travelled`. Numba itself, which takes a second, is not imported.

    The cache may still lack the kernels of a guide, planner or simulator that has not been used yet.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return True
    name = f"{SOURCE.stem}.{_LAST}-*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    return any(_is_for(SOURCE, index) for index in numba_cache.folder(SOURCE).glob(name))


def _is_for(source: Path, index: Path) -> bool:
    """Whether an index of Numba's cache belongs to this version of Numba and of the source.

    The index is a pickle. It names the source by its hash, or in older versions by the time of its last change.
    """
    known = index.read_bytes()
    names = (hashlib.sha256(source.read_bytes()).digest(), struct.pack(">d", source.stat().st_mtime))
    return any(name in known for name in names) and version("numba").encode() in known
