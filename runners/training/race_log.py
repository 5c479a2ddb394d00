"""Logs of scores, appended as lines of JSON: of a race, one for each episode; of a shared study, one for each trial."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

from lme.errors import InputError
from lme.inputs.guarded_file import LOG_BYTES, decode_json, read_bytes
from runners.records.episode_record import cut_torn_line
from runners.workers.trials import Attempt, Score

RACE_LOG, SCORE_LOG = "race.jsonl", "scores.jsonl"


class RaceLog:
    """Scores by candidate and place. Lines of a killed run are read first; use it as a context manager."""

    def __init__(self, path: Path) -> None:
        """Read the existing lines. Raises InputError for a line that does not hold a score."""
        self._path = path
        self._scores: dict[tuple[int, str, int], Score] = {}
        self._file: TextIO | None = None
        for number, line in _complete_lines(path):
            self._keep(_decode_score(line, path, number))

    def __enter__(self) -> RaceLog:
        self._file = self._path.open("a", encoding="utf-8")
        return self

    def __exit__(self, *error: object) -> None:
        if self._file is not None:
            self._file.close()

    def get(self, attempt: Attempt) -> Score | None:
        """Return the score of an attempt; None if it was not driven."""
        return self._scores.get((attempt.trial, attempt.family, attempt.world))

    def add(self, score: Score) -> None:
        """Append a score."""
        assert self._file is not None
        self._file.write(json.dumps(score, separators=(",", ":")) + "\n")
        self._file.flush()
        self._keep(score)

    def __iter__(self) -> Iterator[Score]:
        """Iterate over all scores in the order in which they were driven."""
        return iter(self._scores.values())

    def _keep(self, score: Score) -> None:
        self._scores[score.trial, score.family, score.world] = score


def _decode_score(line: bytes, path: Path, number: int) -> Score:
    try:
        trial, world, outcome, steps, reward, family = decode_json(line)
        return Score(int(trial), int(world), str(outcome), int(steps), float(reward), str(family))
    except (ValueError, TypeError, OverflowError):
        raise InputError(
            f"{path} line {number} does not hold the score of an episode: remove that line"
        ) from None


class ScoreLog:
    """Log with one line per trial: its values and its scores. Lines of a killed run are read first.

    path: None if the study itself is in the run's directory.
    """

    def __init__(self, path: Path | None) -> None:
        """Read the existing lines. Raises InputError for a line that does not hold scores."""
        self._path = path
        self._scores: dict[frozenset[tuple[str, float]], list[Any]] = {}
        if path is None:
            return
        for number, line in _complete_lines(path):
            values, scores = _decode_trial(line, path, number)
            self._scores[values] = scores

    def get(self, values: Mapping[str, float]) -> list[Any] | None:
        """Return the scores of the trial with these values, if there is one; equal values have equal scores."""
        return self._scores.get(frozenset(values.items()))

    def add(self, values: Mapping[str, float], scores: Sequence[Any]) -> None:
        """Append the scores of a trial."""
        if self._path is not None:
            with self._path.open("a") as file:
                file.write(json.dumps([dict(values), list(scores)]) + "\n")


def _decode_trial(line: bytes, path: Path, number: int) -> tuple[frozenset[tuple[str, float]], list[Any]]:
    try:
        values, scores = decode_json(line)
        return frozenset((key, float(value)) for key, value in values.items()), [
            list(score) for score in scores
        ]
    except (ValueError, TypeError, AttributeError, OverflowError):
        raise InputError(
            f"{path} line {number} does not hold the scores of a trial: remove that line"
        ) from None


def _complete_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the numbered lines of a log, without one that a killed run left unfinished; none without a file."""
    if path.is_file():
        cut_torn_line(path)
        yield from enumerate(read_bytes(path, LOG_BYTES).splitlines(), start=1)
