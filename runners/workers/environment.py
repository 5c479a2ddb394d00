"""Environment variables of the processes that a command starts, and the order of their search for modules."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

# Otherwise `python -c` and `python -m` import modules of the working folder instead of those of the standard library.
SAFE_PATH = {"PYTHONSAFEPATH": "1"}


@contextlib.contextmanager
def environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment variables, which processes started in the block inherit."""
    previous_values = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in previous_values.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def search_working_folder_last() -> None:
    """Find modules of the working folder, such as a user's own planner, after all installed ones."""
    working_folder = str(Path.cwd())
    if working_folder not in sys.path:
        sys.path.append(working_folder)
