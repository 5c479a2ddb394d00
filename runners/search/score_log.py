"""The scores of a run's own trials, on its own disk: a shared storage may be away when a trial ends."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from runners.records.append_log import cut_torn_line

SCORE_LOG = "scores.jsonl"


class ScoreLog:
    """One line per trial: its values and its scores. It begins with what a killed run left.

    path: None where the study itself is on that disk.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._scores: dict[frozenset[tuple[str, float]], list[Any]] = {}
        if path is not None and path.is_file():
            cut_torn_line(path)
            for values, scores in map(json.loads, path.read_text().splitlines()):
                self._scores[frozenset(values.items())] = scores

    def get(self, values: Mapping[str, float]) -> list[Any] | None:
        """The scores of the trial with these values; equal values have equal scores."""
        return self._scores.get(frozenset(values.items()))

    def add(self, values: Mapping[str, float], scores: Sequence[Any]) -> None:
        """Append the scores of a trial."""
        if self._path is not None:
            with self._path.open("a") as file:
                file.write(json.dumps([dict(values), list(scores)]) + "\n")
