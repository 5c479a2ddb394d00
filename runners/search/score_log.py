"""The scores of a run's trials, on its own disk: a shared storage may be unreachable when a trial ends."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lme.errors import InputError
from lme.guarded_file import LOG_BYTES, decode_json, read_bytes
from runners.records.append_log import cut_torn_line

SCORE_LOG = "scores.jsonl"


class ScoreLog:
    """One line per trial: its values and its scores. Lines of a killed run are read first.

    path: None if the study itself is on that disk.
    """

    def __init__(self, path: Path | None) -> None:
        """Raises InputError for a line that does not hold scores."""
        self._path = path
        self._scores: dict[frozenset[tuple[str, float]], list[Any]] = {}
        if path is not None and path.is_file():
            cut_torn_line(path)
            for number, line in enumerate(read_bytes(path, LOG_BYTES).splitlines(), start=1):
                values, scores = _decode(line, path, number)
                self._scores[values] = scores

    def get(self, values: Mapping[str, float]) -> list[Any] | None:
        """The scores of the trial with these values; equal values have equal scores."""
        return self._scores.get(frozenset(values.items()))

    def add(self, values: Mapping[str, float], scores: Sequence[Any]) -> None:
        """Append the scores of a trial."""
        if self._path is not None:
            with self._path.open("a") as file:
                file.write(json.dumps([dict(values), list(scores)]) + "\n")


def _decode(line: bytes, path: Path, number: int) -> tuple[frozenset[tuple[str, float]], list[Any]]:
    try:
        values, scores = decode_json(line)
        return frozenset((key, float(value)) for key, value in values.items()), [
            list(score) for score in scores
        ]
    except (ValueError, TypeError, AttributeError, OverflowError):
        raise InputError(
            f"{path} line {number} does not hold the scores of a trial: remove that line"
        ) from None
