"""Evaluate one composed config: episodes to records, records to tables, a figure and a tracked run."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig

from lme.worlds.world import MapSet
from runners.analysis import failures
from runners.config import build, systems
from runners.config.instantiate import build as build_target
from runners.config.overrides import CUSTOM
from runners.config.schema import Explain, Record
from runners.explainer import pages
from runners.records import launch_record
from runners.records.episode_record import EpisodeKey, RunLabels
from runners.records.parquet import EPISODES
from runners.records.records import RecordWriter, read_episodes, read_trajectories
from runners.workers import recorder
from runners.workers.episodes import EpisodePayload, Recordings, initialise
from runners.workers.progress import EpisodeProgress

if TYPE_CHECKING:
    import pandas as pd


def evaluate(config: DictConfig, run_dir: Path) -> pd.DataFrame:
    """Run what is missing of map set × runs, write everything below `run_dir`, and return the records."""
    from runners.analysis.summary import metrics
    from runners.analysis.tables import print_table

    plain = build.plain(config)
    maps = build.map_set(plain)
    labels = run_labels(plain)
    tracking = build_target(plain["tracking"], "tracking")
    tracking.start(plain, run_dir, {**asdict(labels), "command": "eval"}, sweep_directory())
    try:
        drive(plain, labels, maps, run_dir)
    except KeyboardInterrupt:
        print(f"\nStopped. Go on with: lme eval resume={run_dir}", file=sys.stderr)
        raise
    frame, artifacts = report(maps, run_dir)
    artifacts += [*_film(plain, maps, run_dir), *failures.folder(run_dir)]
    print_table(frame)
    print(f"Records, tables and pictures: {run_dir}")
    for place in failures.folder(run_dir):
        print(f"Why the robot went there: {place / failures.INDEX}")
    tracking.finish(metrics(frame), artifacts)
    return frame


def drive(plain: dict[str, Any], labels: RunLabels, maps: MapSet, run_dir: Path) -> None:
    """Run what is missing of map set × runs into the records of `run_dir`, and explain what is to be explained."""
    keys = [EpisodeKey(world, run) for world in maps.numbers for run in range(plain["runs"])]
    executor = build_target(plain["executor"], "executor")
    payload = EpisodePayload(plain, labels, _recordings(plain, run_dir))
    with RecordWriter(run_dir) as writer, EpisodeProgress(labels.system, len(keys)) as progress:
        done = writer.done()
        progress.skip(len(done))
        todo = [key for key in _by_run(keys) if key not in done]
        for result in executor.map(initialise, payload, todo):
            writer.append(result)
            progress.add(result.record.outcome)
        writer.merge()
    pages.as_asked(Explain(plain.get("explain", Explain.none)), run_dir, executor)


def _film(plain: dict[str, Any], maps: MapSet, run_dir: Path) -> list[Path]:
    """A moving picture of the first episode, where something moves in its world."""
    world = maps.numbers[0]
    if not maps.task(world).world.movers:
        return []
    from runners.figures.parts.animation import animate

    path = run_dir / "episode.gif"
    animate(plain, world, 0, path)
    return [path]


def _recordings(plain: dict[str, Any], run_dir: Path) -> Recordings | None:
    """Where recordings go, and the config that they carry; None where none are made."""
    if plain.get("record") != Record.mcap:
        return None
    return Recordings(run_dir / recorder.FOLDER, launch_record.identity(DictConfig(plain)))


def _by_run(keys: list[EpisodeKey]) -> list[EpisodeKey]:
    """All worlds once before any a second time, so that a partial run covers the map set."""
    return sorted(keys, key=lambda key: (key.run, key.world))


def run_labels(plain: dict[str, Any]) -> RunLabels:
    """The columns that say what was run."""
    choices = HydraConfig.get().runtime.choices
    guide, planner = (_chosen(group, plain) for group in ("guide", "planner"))
    return RunLabels(
        system=systems.label(guide, planner),
        guide=guide,
        planner=planner,
        global_map=str(plain["guide"].get("global_map", "")),
        ablation=_ablation(plain),
        weights=plain["weights"],
        robot=plain["robot"]["name"],
        map=str(choices["map"]),
        subset="custom" if plain["map"].get("worlds") else str(plain["map"].get("subset", "")),
    )


def _chosen(group: str, plain: dict[str, Any]) -> str:
    """The option of a group; of a user's own class, its name."""
    option = str(HydraConfig.get().runtime.choices[group])
    return str(plain[group]["_target_"]).rpartition(".")[2] if option == CUSTOM else option


def _ablation(plain: dict[str, Any]) -> str:
    """The option; of several at once their names with + between them.

    Hydra notes no choice of several, so they are read from the command line; where they stand in a file, the
    parameters are named that they set.
    """
    hydra = HydraConfig.get()
    option = hydra.runtime.choices.get("ablation")
    given = [text.partition("=")[2] for text in hydra.overrides.task if text.startswith("ablation=[")]
    several = given[-1].strip("[]").split(",") if given else plain["ablation"]
    return "+".join(name.strip() for name in several) if option is None else str(option)


def sweep_directory() -> Path | None:
    """The directory of the sweep that this job is part of, None where it is part of none."""
    hydra = HydraConfig.get()
    return Path(hydra.sweep.dir) if hydra.mode is RunMode.MULTIRUN else None


def report(maps: MapSet, run_dir: Path) -> tuple[pd.DataFrame, list[Path]]:
    """Write tables and picture, from the records alone; the records and all files."""
    from runners.analysis.tables import write_tables
    from runners.figures.reports.paths import sample_worlds, trajectories_figure

    frame = read_episodes([run_dir])
    tables = write_tables(frame, run_dir)
    picture = run_dir / "trajectories.png"
    tasks = {number: maps.task(number) for number in sample_worlds(frame)}
    trajectories_figure(frame, read_trajectories([run_dir]), tasks, picture)
    return frame, [*tables, picture, run_dir / EPISODES]
