"""What a figure is made of: the runs of a sweep, or a single one, each with its config and its records."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from lme.errors import InputError
from lme.worlds.world import MapSet
from runners.config import build
from runners.config.schema import RecordedConfig
from runners.records import launch_record
from runners.records.records import find_runs, read_episodes, read_trajectories
from runners.workers.trace import Trace, rerun_recorded

if TYPE_CHECKING:
    import pandas as pd


class DrivenRun:
    """One run. config: what it was driven with. frame: its records, one row per episode.

    place: the map's config and the robot's footprint as text, which tells places apart.
    """

    def __init__(self, run_dir: Path, config: RecordedConfig, frame: pd.DataFrame) -> None:
        self.run_dir = run_dir
        self.config = config
        self.frame = frame
        self.place = json.dumps([config.map, asdict(config.robot.footprint)], sort_keys=True)

    @property
    def label(self) -> str:
        """The system, and what was taken away from it or multiplied."""
        first = self.frame.iloc[0]
        changes = (str(first.get("ablation", "none")), str(first.get("scale", "")))
        return ", ".join(
            [str(first["system"]), *(change for change in changes if change not in ("none", ""))]
        )

    @cached_property
    def maps(self) -> MapSet:
        """The map set that was driven in."""
        return build.map_set(self.config, sorted({int(world) for world in self.frame["world"]}))

    @cached_property
    def trajectories(self) -> pd.DataFrame:
        """One row per control step of all episodes."""
        return read_trajectories([self.run_dir])

    def trace(self, world: int, run: int) -> Trace:
        """One of the episodes, driven again. Raises InputError where that is not possible."""
        return rerun_recorded(self.run_dir, world, run, self.trajectories)


class Kind(Protocol):
    """A kind of figure: one file here and one YAML in `conf/figure/` each.

    name: of its files. drives: whether there must be episodes.
    """

    name: str
    drives: bool

    def draw(
        self, jobs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Draw the jobs and save the figure as `stem`.png, …; the paths. worlds: those asked for, or none."""


def read_runs(runs: Sequence[Path]) -> list[DrivenRun]:
    """The jobs of these runs and sweeps, in order. Raises InputError where a path holds none."""
    run_dirs = find_runs(runs)
    frame = read_episodes(run_dirs)
    return runs_of(frame, run_dirs)


def runs_of(frame: pd.DataFrame, run_dirs: Sequence[Path]) -> list[DrivenRun]:
    """The jobs among records that are read already; a folder that tells of no config is left out."""
    launches = [(run_dir, launch_record.read_launch(run_dir)) for run_dir in run_dirs]
    records = {run_dir: frame[frame["run_dir"] == str(run_dir)] for run_dir in run_dirs}
    return [
        DrivenRun(run_dir, launch.config, records[run_dir])
        for run_dir, launch in launches
        if launch is not None and not records[run_dir].empty
    ]


def chosen_world(job: DrivenRun, worlds: Sequence[int]) -> tuple[int, int]:
    """(world, run) of the one episode to draw: of the world asked for, or else the first of the records.

    Raises InputError where the run has no such world.
    """
    known = sorted(zip(job.frame["world"].astype(int), job.frame["run"].astype(int), strict=True))
    found = [key for key in known if not worlds or key[0] == worlds[0]]
    if not found:
        numbers = sorted({world for world, _ in known})
        shown = ", ".join(map(str, numbers[:12])) + (", …" if len(numbers) > 12 else "")
        raise InputError(f"world is {worlds[0]}: {job.run_dir} has only {shown}")
    return found[0]
