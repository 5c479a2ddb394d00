"""Columns that name what a job drives, and the hint with which a run that ends early is resumed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lme.worlds.world import DrawsRobots, MapSet, Named
from runners.config import systems
from runners.config.build import people_of
from runners.config.job import Job
from runners.config.overrides import CUSTOM
from runners.config.quoting import resume_command
from runners.config.schema import DriveConfig
from runners.config.systems import SEVERAL
from runners.records.episode_record import CUSTOM_SUBSET, RunLabels

DRAWN = "drawn"  # instead of a robot's name, if every episode has another robot


def run_labels(job: Job[DriveConfig], maps: MapSet) -> RunLabels:
    """Return the names of system, robot and map for all records of the job. maps: the job's map set."""
    config = job.config
    guide, planner = _option_label("guide", job), _option_label("planner", job)
    return RunLabels(
        system=_system(guide, planner, job),
        guide=guide,
        planner=planner,
        global_map=str(config.guide.get("global_map", "")),
        # Several options are joined by +. If a file chooses several, the parameters that they set are named.
        ablation=job.choices.get("ablation") or SEVERAL.join(config.ablation),
        weights=job.weights,
        robot=DRAWN if isinstance(maps, DrawsRobots) else config.robot.name,
        map=maps.name if isinstance(maps, Named) else job.choices["map"],
        subset=CUSTOM_SUBSET if config.map.get("worlds") else str(config.map.get("subset", "")),
        people=str(people_of(config)),
    )


def _system(guide: str, planner: str, job: Job[DriveConfig]) -> str:
    """Return the label of the chosen system if this is its pair, else that of the named pair."""
    has_changes = any(key.startswith(("guide.", "planner.")) for key in job.changes)
    all_systems = systems.systems(job.folders)
    chosen_systems = [system for name, system in all_systems.items() if name == job.choices.get("system")]
    return systems.label(guide, planner, [*chosen_systems, *all_systems.values()], has_changes)


def _option_label(group: str, job: Job[DriveConfig]) -> str:
    """Return the option of a group, or the name of a user's own class."""
    node = {"guide": job.config.guide, "planner": job.config.planner}[group]
    option = job.choices[group]
    return str(node["_target_"]).rpartition(".")[2] if option == CUSTOM else option


@contextmanager
def resume_hint(command: str, run_dir: Path) -> Iterator[None]:
    """Print the command that resumes the run in `run_dir` if Ctrl-C or SIGTERM ends the block."""
    try:
        yield
    except KeyboardInterrupt:
        print(
            f"\nStopped; finished work is kept. Continue with: {resume_command(command, run_dir)}",
            file=sys.stderr,
        )
        raise
