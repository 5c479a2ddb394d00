"""Check for compiled kernels: the first episode after installation has to wait for their compilation."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version
from pathlib import Path

import lme
from lme import numba_cache

SOURCE = Path(lme.__file__).parent / "geometry" / "motion.py"
_LAST = "travelled"  # the kernel of SOURCE that the first step of an episode calls last


def compiled() -> bool:
    """Return whether Numba's cache has `travelled` for this version of Numba.

    Numba is not imported, which would take a second. The cache may still lack the kernels of a guide, planner or
    simulator that was never used.
    """
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return True
    name = f"{SOURCE.stem}.{_LAST}-*.py{sys.version_info.major}{sys.version_info.minor}*.nbi"
    indices = numba_cache.folder(SOURCE).glob(name)
    return any(version("numba").encode() in index.read_bytes() for index in indices)
