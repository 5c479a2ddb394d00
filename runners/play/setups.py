"""From the words of a command line to what a session drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lme.errors import InputError
from lme.worlds.check import check_task
from lme.worlds.world import Task
from runners.config import build, command_line, weights
from runners.config.composer import Composer
from runners.config.job import Job
from runners.config.schema import DriveConfig
from runners.experiments.labels import run_labels
from runners.play.session import Setup, System

LANES = 4  # side by side


@dataclass(frozen=True, slots=True)
class Composed:
    """The jobs of a command line, the systems that they make, and the first world of their map set."""

    jobs: tuple[Job[Any], ...]
    task: Task

    def setup(self, run: int) -> Setup:
        """What a session begins with."""
        return Setup(
            tuple(System(job.config, label) for job, label in zip(self.jobs, self._labels(), strict=True)),
            self.task,
            run,
        )

    def _labels(self) -> list[str]:
        """The names of the systems, with what tells those of one name apart."""
        labels = [run_labels(job, build.map_set(job.config, [self.task.number])) for job in self.jobs]
        names = [
            f"{label.system}, {label.ablation}" if label.ablation not in ("", "none") else label.system
            for label in labels
        ]
        if len(set(names)) == len(names):
            return names
        return [
            f"{name} ({job.changes_text or 'unchanged'})" for name, job in zip(names, self.jobs, strict=True)
        ]


def composed(
    words: Sequence[str], config_dir: Path | None = None, config_name: str = "play", world: int | None = None
) -> Composed:
    """What the words come to. world: its number; None: the first of the map set. Raises InputError."""
    with Composer(config_name, config_dir) as composer:
        plan = command_line.plan(composer, words, multirun=True, typed=words)
        if plan.num_jobs > LANES:
            raise InputError(f"{plan.num_jobs} systems: must be at most {LANES} side by side")
        jobs = tuple(command_line.validated(plan, composer, _check))
    _check_together(jobs)
    task = task_of(jobs[0].config, world)
    for job in jobs:
        check_task(task, job.config.robot)
    return Composed(jobs, task)


def task_of(config: DriveConfig, world: int | None) -> Task:
    """The task in a world of a config's map set; the first for None. Raises InputError."""
    maps = build.map_set(config, None if world is None else [world])
    return maps.task(maps.numbers[0])


def _check(job: Job[Any]) -> None:
    weights.check_scale(getattr(job.config, "scale", {}), job.config.guide)
    build.simulator(job.config)


def _check_together(jobs: Sequence[Job[Any]]) -> None:
    """Raise InputError unless all drive in the same world, in the same time steps, with the same random numbers."""
    first = jobs[0].config
    for key, value in (
        ("map", first.map),
        ("crowd", first.crowd),
        ("seed", first.seed),
        ("run", getattr(first, "run", 0)),
    ):
        if any(getattr(job.config, key, 0) != value for job in jobs):
            raise InputError(
                f"{key} is swept: side by side are different systems in one world; must be one value"
            )
    if len({job.config.robot.dt for job in jobs}) > 1:
        raise InputError("robot is swept: robots side by side must have the same control_rate")
