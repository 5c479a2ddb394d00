"""The append log of a run: one line of JSON per finished episode, appended when the episode ends.

A line counts once its newline is on disk. Arrays are stored byte for byte, so an episode that is read back equals
the episode that was written.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from runners.records.episode_record import COLUMNS, KEY_COLUMNS, TEXTS, EpisodeKey, EpisodeResult

APPEND_LOG = "parts/episodes.jsonl"


class LogEntry(NamedTuple):
    """One line, by column name. Another version of the program may have written it, with other columns.

    row: of `episodes.parquet`. trajectory: 1-D arrays of equal length.
    """

    row: dict[str, Any]
    trajectory: dict[str, NDArray[Any]]

    @property
    def key(self) -> EpisodeKey:
        """Which episode this is."""
        return EpisodeKey.of(self.row)


def encode(result: EpisodeResult) -> bytes:
    """The line of an episode. An array is [dtype, base64 of its bytes]: exact, and shorter than decimal digits."""
    from lme.episode import TRAJECTORY_COLUMNS

    columns = zip(TRAJECTORY_COLUMNS, result.trajectory.T, strict=True)
    arrays = {
        name: [array.dtype.str, base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()]
        for name, array in columns
    }
    entry = {"record": result.record.columns(), "trajectory": arrays}
    return json.dumps(entry, default=lambda scalar: scalar.item()).encode() + b"\n"


def read_log(path: Path) -> Iterator[LogEntry]:
    """Entries of an append log, the first of each key. A last line without a newline is left out.

    Raises InputError for a line that is not an episode.
    """
    if not path.is_file():
        return
    seen: set[EpisodeKey] = set()
    with path.open("rb") as lines:
        for number, line in enumerate(lines, start=1):
            if not line.endswith(b"\n"):
                return
            entry = _decode(line, path, number)
            if entry.key not in seen:
                seen.add(entry.key)
                yield entry


def _decode(line: bytes, path: Path, number: int) -> LogEntry:
    try:
        fields = json.loads(line)
        arrays = {
            name: np.frombuffer(base64.b64decode(data), dtype=np.dtype(kind))
            for name, (kind, data) in fields["trajectory"].items()
        }
        entry = LogEntry(fields["record"], arrays)
        _check(entry)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        raise InputError(f"{path} line {number} is not an episode record: remove that line") from None
    return entry


def _check(entry: LogEntry) -> None:
    """Raise ValueError, TypeError or KeyError unless the values are of the kinds that `encode` writes."""
    if any(type(entry.row[name]) is not int for name in KEY_COLUMNS):
        raise TypeError("a world or run is no whole number")
    for name, value in entry.row.items():
        kind = str if name in TEXTS else int | float if name in COLUMNS else str | int | float
        if value is not None and not isinstance(value, kind):
            raise TypeError(f"{name} is {value!r}")
        if isinstance(value, int) and abs(value) >= 2**63:
            raise ValueError(f"{name} is too large")
    texts = [value for value in entry.row.values() if isinstance(value, str)]
    "".join(
        [*entry.row, *entry.trajectory, *texts]
    ).encode()  # JSON may hold half characters, Parquet may not
    lengths = {len(array) for array in entry.trajectory.values()}
    if len(lengths) > 1 or any(array.dtype.kind not in "fiu" for array in entry.trajectory.values()):
        raise ValueError("the columns of the trajectory do not fit each other")


def cut_torn_line(path: Path) -> None:
    """Remove a last line without a newline, which a killed run left; the next line would be joined to it."""
    if path.is_file():
        content = path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            os.truncate(path, whole)


def lock(file: Any, run_dir: Path) -> None:
    """Lock an open file, so that only one process writes the run. The lock ends with the process.

    Raises InputError, naming `run_dir`, where another process holds the lock.
    """
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"{run_dir} is being written by another process: wait for it, or choose another hydra.run.dir"
        ) from None
