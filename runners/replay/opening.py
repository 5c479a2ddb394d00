"""Opens a recording of any format."""

from __future__ import annotations

from pathlib import Path

from runners.replay.bags import Bag
from runners.replay.carmen import CarmenLog, is_carmen


def open_recording(path: Path) -> Bag:
    """Open a ROS recording or a CARMEN log, by its name. Raises InputError if it is not one, or cannot be read."""
    return CarmenLog(path) if is_carmen(path) else Bag(path)
