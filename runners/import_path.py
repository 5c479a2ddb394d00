"""Where modules are searched for."""

from __future__ import annotations

import sys
from pathlib import Path


def search_working_folder_last() -> None:
    """Find modules of the working folder, such as a user's own planner, after all installed ones."""
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
