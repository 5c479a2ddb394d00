"""Checks whether the kernels are already compiled; the first episode after installation waits for that."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path


def compiled() -> bool:
    """Whether Numba's cache has the current `travelled`, the last kernel that the first step of an episode calls.

    The cache may still lack the kernels of a guide, planner or simulator that has not been used yet.
    """
    from lme.kernels.motion import travelled

    stats = getattr(travelled, "stats", None)
    if stats is None:  # a plain function, with NUMBA_DISABLE_JIT
        return True
    code = travelled.py_func.__code__
    source = Path(code.co_filename)
    python = f"py{sys.version_info.major}{sys.version_info.minor}"
    name = f"{source.stem}.{code.co_name}-{code.co_firstlineno}.{python}*.nbi"
    return any(_is_for(source, index) for index in Path(stats.cache_path).glob(name))


def _is_for(source: Path, index: Path) -> bool:
    """Whether an index of Numba's cache belongs to this version of Numba and of the source.

    Numba identifies a source by its hash; older versions use the time of its last change.
    """
    import numba

    known = index.read_bytes()
    newer = index.stat().st_mtime >= source.stat().st_mtime
    same = newer or hashlib.sha256(source.read_bytes()).digest() in known
    return same and numba.__version__.encode() in known
