"""The parts file: one line per finished episode, appended as it finishes.

A line is complete once its end is there. Arrays are stored byte for byte, so that an episode read back is
the episode that was written.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lme.errors import InputError

PARTS = "parts/episodes.jsonl"

Record = Mapping[str, Any]
Trajectory = Mapping[str, np.ndarray]
Key = tuple[int, int]  # (world, run)


class Episode(NamedTuple):
    """What a worker hands back: scalars by name, and equal-length arrays by name."""

    record: dict[str, Any]
    trajectory: dict[str, np.ndarray]

    @property
    def key(self) -> Key:
        return self.record["world"], self.record["run"]


def encode(record: Record, trajectory: Trajectory) -> bytes:
    """One line. Arrays go as [dtype, base64 of their bytes]: exact, and smaller than digits."""
    arrays = {
        name: [array.dtype.str, base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()]
        for name, array in trajectory.items()
    }
    line = json.dumps({"record": dict(record), "trajectory": arrays}, default=lambda scalar: scalar.item())
    return line.encode() + b"\n"


def read_parts(path: Path) -> Iterator[Episode]:
    """Episodes of a parts file, the first of each key; a last line without its end is not there yet."""
    if not path.is_file():
        return
    seen: set[Key] = set()
    with path.open("rb") as lines:
        for number, line in enumerate(lines, start=1):
            if not line.endswith(b"\n"):
                return
            episode = _decode(line, path, number)
            if episode.key not in seen:
                seen.add(episode.key)
                yield episode


def _decode(line: bytes, path: Path, number: int) -> Episode:
    try:
        fields = json.loads(line)
        arrays = {
            name: np.frombuffer(base64.b64decode(data), dtype=np.dtype(kind))
            for name, (kind, data) in fields["trajectory"].items()
        }
        episode = Episode(fields["record"], arrays)
        _ = episode.key
    except (ValueError, TypeError, KeyError, AttributeError):
        raise InputError(f"{path} line {number} is not an episode record: remove that line") from None
    return episode


def cut_torn_line(path: Path) -> None:
    """A run killed in the middle of a line left its beginning; what comes next must not be glued to it."""
    if path.is_file():
        content = path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            os.truncate(path, whole)


def lock(file: Any, run_dir: Path) -> None:
    """Two processes that resume the same run would cut each other's lines. The lock dies with its process."""
    try:
        import fcntl
    except ImportError:  # no such locks on Windows
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"{run_dir} is being written by another process: wait for it, or choose another hydra.run.dir"
        ) from None
