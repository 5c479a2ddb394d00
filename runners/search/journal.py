"""Optuna's journal in a file that one process owns: the file's format is Optuna's, the writing is in whole steps.

Entries wait in memory until `flush`, which writes them with a mark behind them: how many entries there are now.
What a kill or a power cut leaves behind the last mark does not count, so a batch of trials is there with all
its parameters or not at all. It also costs one write to disk rather than one for each parameter.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from optuna.storages.journal import BaseJournalBackend

from lme.errors import InputError

_SET_STUDY_SYSTEM_ATTR = 3  # op_code of the entry that serves as a mark
_MARK = "lme:entries"
_BEGINNING = b'{"op_code":'


class Journal(BaseJournalBackend):
    """A journal of one study. Raises InputError where the file holds what is none, or where lines are missing."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._entries = list(_whole_steps(path))
        self._waiting: list[str] = []

    def read_logs(self, log_number_from: int) -> Iterator[dict[str, Any]]:
        """Entries from this number on."""
        return iter(self._entries[log_number_from:])

    def append_logs(self, logs: list[dict[str, Any]]) -> None:
        """Keep entries for the next flush."""
        lines = [json.dumps(entry, separators=(",", ":")) for entry in logs]
        # As they will be read again: whoever resumes must see what this process sees.
        self._entries += map(json.loads, lines)
        self._waiting += lines

    def flush(self) -> None:
        """Put what waits on disk, as one step."""
        if not self._waiting:
            return
        last = self._entries[-1]
        mark = {"op_code": _SET_STUDY_SYSTEM_ATTR, "worker_id": last["worker_id"], "study_id": 0}
        self.append_logs([{**mark, "system_attr": {_MARK: len(self._entries) + 1}}])
        with self._path.open("ab") as file:
            file.write("".join(f"{line}\n" for line in self._waiting).encode())
            file.flush()
            os.fsync(file.fileno())
        self._waiting.clear()


def _whole_steps(path: Path) -> Iterator[dict[str, Any]]:
    """The entries of a journal up to its last mark; cuts what lies behind it off the file."""
    content = path.read_bytes() if path.is_file() else b""
    if not _BEGINNING.startswith(content[: len(_BEGINNING)]):  # not ours: nothing may be cut off it
        raise _no_entry(path, 1)
    lines = content.splitlines(keepends=True)
    mark = f'"{_MARK}":'.encode()
    while lines and not (mark in lines[-1] and lines[-1].endswith(b"\n")):
        lines.pop()
    if path.is_file():
        os.truncate(path, sum(map(len, lines)))
    for number, line in enumerate(lines, start=1):
        entry = _decoded(line, path, number)
        counted = (entry.get("system_attr") or {}).get(_MARK, number)
        if counted != number:
            raise InputError(
                f"{path} line {number}: should be line {counted}, so lines are missing or were added; restore the "
                "file, or start another study"
            )
        yield entry


def _decoded(line: bytes, path: Path, number: int) -> dict[str, Any]:
    try:
        entry: dict[str, Any] = json.loads(line)
        _ = entry["op_code"], entry["worker_id"]
    except (ValueError, KeyError, TypeError):
        raise _no_entry(path, number) from None
    return entry


def _no_entry(path: Path, number: int) -> InputError:
    return InputError(
        f"{path} line {number}: no entry of an Optuna journal; restore the file, or start another study"
    )
