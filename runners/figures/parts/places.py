"""Where a sweep drove: the worlds of a map set, or several starts in one world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError
from lme.worlds.world import Task
from runners.figures.parts.driven_runs import DrivenRun
from runners.figures.reports.paths import sample_worlds

SAMPLED = 3  # worlds of a map set whose worlds differ


@dataclass(frozen=True, slots=True, eq=False)
class DrivenPlace:
    """One place.

    jobs: those that drove in its map. numbers: the worlds drawn over one another, all with the obstacles of `task`.
    """

    name: str
    jobs: tuple[DrivenRun, ...]
    task: Task
    numbers: tuple[int, ...]


def places(jobs: Sequence[DrivenRun], worlds: Sequence[int] = ()) -> list[DrivenPlace]:
    """Each of `worlds` in each map; or one for a map whose worlds are all alike, some of one whose worlds differ.

    Raises InputError for a world that no job has driven in.
    """
    _check_driven(jobs, worlds)
    return [
        place
        for key in dict.fromkeys(job.place for job in jobs)
        for place in _places_of([job for job in jobs if job.place == key], worlds)
    ]


def _places_of(jobs: Sequence[DrivenRun], worlds: Sequence[int]) -> list[DrivenPlace]:
    """Those of the jobs of one map."""
    name, maps = _map_name(jobs[0]), jobs[0].maps
    numbers = sorted({int(number) for job in jobs for number in job.frame["world"]})
    if not worlds and len(numbers) > 1:
        first, second = (maps.task(number) for number in numbers[:2])
        if _same_obstacles(first, second):
            return [DrivenPlace(name, tuple(jobs), first, tuple(numbers))]
    chosen = [number for number in worlds if number in numbers]
    if not worlds:
        chosen = sample_worlds(jobs[0].frame, SAMPLED)
    return [
        DrivenPlace(f"{name}, world {number}", tuple(jobs), maps.task(number), (number,)) for number in chosen
    ]


def _check_driven(jobs: Sequence[DrivenRun], worlds: Sequence[int]) -> None:
    known = sorted({int(number) for job in jobs for number in job.frame["world"]})
    for world in worlds:
        if world not in known:
            shown = ", ".join(map(str, known[:12])) + (", …" if len(known) > 12 else "")
            raise InputError(f"world is {world}: no episode was driven there, only in {shown}")


def _map_name(job: DrivenRun) -> str:
    """A map set that comes in kinds, by its kind."""
    name, kind = str(job.frame["map"].iloc[0]), job.config.map.get("kind")
    return f"{name}: {kind}" if kind else name


def _same_obstacles(one: Task, other: Task) -> bool:
    return np.array_equal(one.world.circles, other.world.circles) and np.array_equal(
        one.world.edges, other.world.edges
    )
