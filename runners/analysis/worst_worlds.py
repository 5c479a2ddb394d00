"""The held-out worlds on which the result of a training does worst."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.analysis.paired import SUCCESS
from runners.records.episode_record import EpisodeKey

if TYPE_CHECKING:
    import pandas as pd

_Key = tuple[str, EpisodeKey]


@dataclass(frozen=True, slots=True)
class WorstWorld:
    """A world, by its worst episode. outcome, reward, time_s [s]: of this episode.

    runs, failed: how many episodes there are, and how many failed. start_failed: of the start; None if the start is the
    result. lost: how many failed where the start succeeded.
    """

    run_dir: Path
    key: EpisodeKey
    outcome: str
    reward: float
    time_s: float
    runs: int
    failed: int
    start_failed: int | None
    lost: int


def worst_worlds(frame: pd.DataFrame, start: pd.DataFrame | None, count: int) -> list[WorstWorld]:
    """At most `count` worlds: those with failures first, then those with the lowest reward.

    Of equal ones, those where the start succeeded most often come first. frame, start: records with their `run_dir`
    and the column `reward`; maps have directories of the same name. start: None if the start is the result.
    """
    good = None if start is None else _good(start)
    by_world: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for row in frame.to_dict("records"):
        by_world.setdefault((str(row["run_dir"]), int(row["world"])), []).append(row)
    return sorted((_world(rows, good) for rows in by_world.values()), key=_order)[:count]


def regressions(frame: pd.DataFrame, start: pd.DataFrame) -> int:
    """In how many episodes the result fails where the start succeeded."""
    good = _good(start)
    return sum(_failed(row) and _key(row) in good for row in frame.to_dict("records"))


def _world(rows: Sequence[Mapping[str, Any]], good: set[_Key] | None) -> WorstWorld:
    failed = [row for row in rows if _failed(row)]
    lost = [row for row in failed if good is not None and _key(row) in good]
    worst = min(rows, key=lambda row: (not _failed(row), row["reward"], row not in lost))
    return WorstWorld(
        Path(worst["run_dir"]),
        EpisodeKey.of(worst),
        str(worst["outcome"]),
        float(worst["reward"]),
        float(worst["time_s"]),
        len(rows),
        len(failed),
        None if good is None else sum(_key(row) not in good for row in rows),
        len(lost),
    )


def _order(world: WorstWorld) -> tuple[bool, float, int, int]:
    return world.outcome == SUCCESS, world.reward, -world.lost, -world.failed


def _failed(row: Mapping[str, Any]) -> bool:
    return bool(row["outcome"] != SUCCESS)


def _good(start: pd.DataFrame) -> set[_Key]:
    """The episodes in which the start succeeded."""
    return {_key(row) for row in start.to_dict("records") if not _failed(row)}


def _key(row: Mapping[str, Any]) -> _Key:
    """What an episode of the result and one of the start have in common: the map and the key."""
    return Path(row["run_dir"]).name, EpisodeKey.of(row)
