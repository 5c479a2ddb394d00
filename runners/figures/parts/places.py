"""Places of a sweep: the worlds of a map set, or several starts in one world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError
from lme.worlds.world import Task
from runners.figures.parts.driven_runs import DrivenRun
from runners.figures.reports.paths import sample_worlds

SAMPLED = 3  # worlds shown of a map set whose worlds differ


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPlace:
    """One place.

    runs: those in its map. numbers: the worlds drawn over one another, all with the obstacles of `task`.
    """

    name: str
    runs: tuple[DrivenRun, ...]
    task: Task
    numbers: tuple[int, ...]


def places(runs: Sequence[DrivenRun], worlds: Sequence[int] = ()) -> list[DrivenPlace]:
    """The places to draw: each of `worlds` in each map.

    Without `worlds`: one place for a map whose worlds have the same obstacles, a sample of worlds for any other.
    Raises InputError for a world without an episode.
    """
    _check_driven(runs, worlds)
    return [
        place
        for key in dict.fromkeys(run.place for run in runs)
        for place in _places_of([run for run in runs if run.place == key], worlds)
    ]


def _places_of(runs: Sequence[DrivenRun], worlds: Sequence[int]) -> list[DrivenPlace]:
    """The places of runs in one map."""
    name, maps = _map_name(runs[0]), runs[0].maps
    numbers = sorted({int(number) for run in runs for number in run.frame["world"]})
    if not worlds and len(numbers) > 1:
        first, second = (maps.task(number) for number in numbers[:2])
        if _same_obstacles(first, second):
            return [DrivenPlace(name, tuple(runs), first, tuple(numbers))]
    chosen = [number for number in worlds if number in numbers]
    if not worlds:
        chosen = sample_worlds(runs[0].frame, SAMPLED)
    return [
        DrivenPlace(f"{name}, world {number}", tuple(runs), maps.task(number), (number,)) for number in chosen
    ]


def _check_driven(runs: Sequence[DrivenRun], worlds: Sequence[int]) -> None:
    known = sorted({int(number) for run in runs for number in run.frame["world"]})
    for world in worlds:
        if world not in known:
            shown = ", ".join(map(str, known[:12])) + (", …" if len(known) > 12 else "")
            raise InputError(f"world is {world}: no episode was driven there, only in {shown}")


def _map_name(run: DrivenRun) -> str:
    """The name of the map set, with its kind where it has one."""
    name, kind = str(run.frame["map"].iloc[0]), run.worlds_config.map.get("kind")
    return f"{name}: {kind}" if kind else name


def _same_obstacles(one: Task, other: Task) -> bool:
    return np.array_equal(one.world.circles, other.world.circles) and np.array_equal(
        one.world.edges, other.world.edges
    )
