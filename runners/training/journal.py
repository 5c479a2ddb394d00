"""A journal in Optuna's file format that only one process uses and that is written in complete steps.

Entries stay in memory until `flush` writes them, followed by a mark with the number of entries in the file. Entries
after the last mark are discarded, so after a kill or a power cut a batch of trials is complete or absent. A step
also takes one write to disk instead of one for each parameter.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from optuna.storages.journal import BaseJournalBackend

from lme.errors import InputError
from lme.inputs.guarded_file import LOG_BYTES, decode_json, read_bytes

_SET_STUDY_SYSTEM_ATTR = 3  # op_code of the entries that mark the end of a step
_MARK = "lme:entries"
_BEGINNING = b'{"op_code":'


class Journal(BaseJournalBackend):
    """Journal of one study. Raises InputError if the file is not a journal, or if lines are missing."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._entries = list(_complete_steps(path))
        self._unwritten_lines: list[str] = []

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """Return the entries from this number on, in order."""
        return iter(self._entries[log_number_from:])

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Keep entries until the next flush."""
        lines = [json.dumps(entry, separators=(",", ":")) for entry in logs]
        # Decoded again so that this process sees the same values as one that resumes from the file.
        self._entries += map(json.loads, lines)
        self._unwritten_lines += lines

    def flush(self) -> None:
        """Write the waiting entries to disk as one step."""
        if not self._unwritten_lines:
            return
        # The mark holds the number of its own line, so that missing or added lines are found.
        last_entry = self._entries[-1]
        mark = {"op_code": _SET_STUDY_SYSTEM_ATTR, "worker_id": last_entry["worker_id"], "study_id": 0}
        self.append_logs([{**mark, "system_attr": {_MARK: len(self._entries) + 1}}])
        with self._path.open("ab") as file:
            file.write("".join(f"{line}\n" for line in self._unwritten_lines).encode())
            file.flush()
            os.fsync(file.fileno())
        self._unwritten_lines.clear()


def _complete_steps(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the entries of a journal up to its last mark, and cut off the rest of the file."""
    try:
        content = read_bytes(path, LOG_BYTES)
    except FileNotFoundError:
        content = b""
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if not _BEGINNING.startswith(content[: len(_BEGINNING)]):  # another file: leave it as it is
        raise _not_an_entry(path, 1)
    # Cut off the lines after the last complete mark: a killed process wrote only part of its step.
    lines = content.splitlines(keepends=True)
    mark = f'"{_MARK}":'.encode()
    while lines and not (mark in lines[-1] and lines[-1].endswith(b"\n")):
        lines.pop()
    if path.is_file():
        os.truncate(path, sum(map(len, lines)))
    # Check that every mark is in the line that it names.
    for number, line in enumerate(lines, start=1):
        entry = _decode(line, path, number)
        expected_number = (entry.get("system_attr") or {}).get(_MARK, number)
        if expected_number != number:
            raise InputError(
                f"{path} line {number}: should be line {expected_number!r:.40}, so lines are missing or were added; "
                "restore the file, or start another study"
            )
        yield entry


def _decode(line: bytes, path: Path, number: int) -> dict[str, Any]:
    try:
        entry: dict[str, Any] = decode_json(line)
        _ = entry["op_code"], entry["worker_id"], dict(entry.get("system_attr") or {})
        if not all(isinstance(value, int | float) for value in entry.get("values") or []):
            raise TypeError("a reward must be a number")
    except (ValueError, KeyError, TypeError):
        raise _not_an_entry(path, number) from None
    return entry


def _not_an_entry(path: Path, number: int) -> InputError:
    return InputError(
        f"{path} line {number}: is not an entry of an Optuna journal; restore the file, or start another study"
    )
