"""The input of a figure: the runs of a sweep, or a single run, each with its config and records."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, astuple
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from lme.errors import InputError
from lme.worlds.world import MapSet
from runners.config import build
from runners.config.schema import RecordedConfig
from runners.records import launch_record
from runners.records.episode_record import KEY_COLUMNS, EpisodeKey
from runners.records.launch_record import Launch
from runners.records.records import find_runs, read_episodes, read_trajectories
from runners.workers.steps import step_tables
from runners.workers.trace import Trace, rerun_recorded

if TYPE_CHECKING:
    import pandas as pd

    from runners.figures.parts.moment import Guided


class DrivenRun:
    """One run. frame: its records, one row per episode. worlds_config: its config without the system.

    place: the map's config and the robot's footprint as JSON, equal for runs that share a place.
    """

    def __init__(self, run_dir: Path, launch: Launch, frame: pd.DataFrame) -> None:
        self.run_dir = run_dir
        self.frame = frame
        self._launch = launch
        self.worlds_config = launch.worlds_config
        self.place = json.dumps(
            [self.worlds_config.map, asdict(self.worlds_config.robot.footprint)], sort_keys=True
        )

    @cached_property
    def config(self) -> RecordedConfig:
        """The config of the run. Raises UntrustedError if it names code that may not be executed."""
        return self._launch.config

    @property
    def label(self) -> str:
        """The name of the system, with its ablation and scale where it has them."""
        first = self.frame.iloc[0]
        changes = (str(first.get("ablation", "none")), str(first.get("scale", "")))
        return ", ".join(
            [str(first["system"]), *(change for change in changes if change not in ("none", ""))]
        )

    @cached_property
    def maps(self) -> MapSet:
        """The map set of the run."""
        return build.map_set(self.worlds_config, sorted({int(world) for world in self.frame["world"]}))

    @cached_property
    def trajectories(self) -> pd.DataFrame:
        """One row per recorded control step of all episodes."""
        return read_trajectories([self.run_dir])

    def steps(self, worlds: Collection[int]) -> pd.DataFrame:
        """One row per control step in these worlds. Episodes that lack theirs are driven again, once.

        Raises InputError if that is not possible.
        """
        import pandas as pd

        kept = {*map(tuple, self.trajectories[list(KEY_COLUMNS)].drop_duplicates().to_numpy().tolist())}
        rows = self.frame[self.frame["world"].isin(worlds)].to_dict("records")
        lacking = {key: row for row in rows if astuple(key := EpisodeKey.of(row)) not in kept}
        if lacking:
            again = (table.to_pandas() for table in step_tables(self.run_dir, lacking))
            self.trajectories = pd.concat([*([self.trajectories] if kept else []), *again])
        return self.trajectories[self.trajectories["world"].isin(worlds)]

    def trace(self, world: int, run: int) -> Trace:
        """Drive an episode again and return its trace. Raises InputError if that is not possible."""
        return rerun_recorded(self.run_dir, world, run, self.trajectories)


class Kind(Protocol):
    """A kind of figure: one file in `runners/figures/kinds/` and one YAML in `conf/figure/`.

    name: stem of its files. drives: whether it needs episodes. guided: the guide whose decisions it draws; None if it
    draws any system.
    """

    name: str
    drives: bool
    guided: Guided | None

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Draw the runs, save the figure as `stem`.png, …, and return the paths. worlds: as requested, may be empty."""


def read_runs(paths: Sequence[Path]) -> list[DrivenRun]:
    """The runs below these paths of runs and sweeps, in order. Raises InputError for a path without records."""
    run_dirs = find_runs(paths)
    frame = read_episodes(run_dirs)
    return runs_of(frame, run_dirs)


def runs_of(frame: pd.DataFrame, run_dirs: Sequence[Path]) -> list[DrivenRun]:
    """The runs of records that are already read. Skips a folder without a launch record."""
    launches = [(run_dir, launch_record.read_launch(run_dir)) for run_dir in run_dirs]
    records = {run_dir: frame[frame["run_dir"] == str(run_dir)] for run_dir in run_dirs}
    return [
        DrivenRun(run_dir, launch, records[run_dir])
        for run_dir, launch in launches
        if launch is not None and not records[run_dir].empty
    ]


def chosen_world(driven: DrivenRun, worlds: Sequence[int]) -> tuple[int, int]:
    """(world, run number) of the episode to draw: the first in the first of `worlds`, else the first of all.

    Raises InputError if the run has no episode in that world.
    """
    known = sorted(zip(driven.frame["world"].astype(int), driven.frame["run"].astype(int), strict=True))
    found = [key for key in known if not worlds or key[0] == worlds[0]]
    if not found:
        numbers = sorted({world for world, _ in known})
        shown = ", ".join(map(str, numbers[:12])) + (", …" if len(numbers) > 12 else "")
        raise InputError(f"world is {worlds[0]}: {driven.run_dir} has only {shown}")
    return found[0]
