"""Evaluate one job: episodes to records, records to tables, a figure and a tracked run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from lme.errors import InputError
from lme.worlds.world import DrawsRobots, MapSet
from runners.config import ablations, build, instantiate, systems, weights
from runners.config.instantiate import configured
from runners.config.job import Job
from runners.config.schema import EpisodesConfig, EvalConfig, Record, ReportConfig
from runners.evaluate.labels import resume_hint, run_labels
from runners.records.episode_record import EpisodeKey, RunLabels
from runners.records.launch_record import identity
from runners.records.parquet import EPISODES
from runners.records.records import RecordWriter, read_episodes
from runners.reports.analysis import failures
from runners.reports.explainer import pages
from runners.tracking.mlflow import Tracking, closed_by
from runners.tracking.names import parameters
from runners.workers import recorder
from runners.workers.episodes import EpisodePayload, Recordings, initialise
from runners.workers.progress import EpisodeProgress

if TYPE_CHECKING:
    import pandas as pd

    from runners.reports.analysis.summary import Row


def validate(job: Job[EvalConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    weights.check_scale(job.config.scale, job.config.guide)
    check_report(job)
    _check_drawn(job)
    build.check_drive(job.config)


def _check_drawn(job: Job[EvalConfig]) -> None:
    """Raise InputError for keys that a map set that draws a robot per episode cannot support, or does not use."""
    maps = build.map_set(job.config)
    if not isinstance(maps, DrawsRobots):
        return
    if job.choices.get("crowd", "none") != "none":
        raise InputError(
            f"crowd is {job.choices['crowd']}: must be none where the map draws a robot for every episode"
        )
    # Keys that the map set draws must not be given as well.
    reported = {
        "planner.latency",
        "filter.latency",
        *(f"sim.{key}" for key in maps.drawn(maps.numbers[0]).disturbances),
    }
    for key, value in {**_chosen_robot(job), **job.changes}.items():
        if key in reported or key.partition(".")[0] == "robot":
            raise InputError(
                f"{key} is {value}: must be left out where the map draws it for every episode (map.ranges)"
            )
    if job.config.record is Record.mcap:
        raise InputError(
            "record is mcap: must be none where the map draws a robot for every episode, as a recording holds one robot"
        )
    if "no_latency" in job.choices.get("ablation", ""):
        raise InputError(
            "ablation is no_latency: must be another one where the map draws the delay, which a planner then knows"
        )


def _chosen_robot(job: Job[EvalConfig]) -> dict[str, str]:
    """Return the choice of a robot on the command line, if there is one."""
    words = (word.lstrip("+").partition("=") for word in job.overrides)
    return {key: value for key, _, value in words if key == "robot"}


def check_report(job: Job[ReportConfig]) -> None:
    """Raise InputError if a job cannot record or report as its config says."""
    config = job.config
    systems.check_names(config.table, job.folders)
    if config.record is Record.mcap:
        recorder.check_installed()
    configured(config.tracking, "tracking")


def evaluate(job: Job[EvalConfig]) -> None:
    """Run the missing episodes of map set × runs, and write everything below the job's run directory."""
    from runners.reports.analysis.summary import metrics
    from runners.reports.analysis.tables import print_table

    maps = build.map_set(job.config)
    with closed_by(start_tracking(job, maps)) as tracking:
        # Drive the missing episodes, and write everything that follows from the records.
        with resume_hint("eval", job.run_dir):
            frame, rows, artifacts = run_and_report(job, maps)
        # Print the table, and where everything is.
        print_table(frame, rows)
        if limits := build.describe_limits(job.config, frame):
            print(limits)
        print(f"Records, tables and pictures: {job.run_dir}")
        for directory in failures.folder(job.run_dir):
            print(f"Why the robot went there: {directory / failures.INDEX}")
        tracking.finish(metrics(frame), artifacts)


def start_tracking(job: Job[EvalConfig], maps: MapSet) -> Tracking:
    """Open the tracked run of a job as its config says. maps: the job's map set."""
    labels = run_labels(job, maps)
    tracking: Tracking = instantiate.build(job.config.tracking, "tracking")
    tags = {**asdict(labels), "changes": job.changes_text, "command": "eval"}
    config = {**asdict(job.config), "weights": job.weights}
    tracking.start(parameters(config, labels), job.run_dir, tags, job.sweep_dir)
    return tracking


def run_and_report(
    job: Job[EvalConfig], maps: MapSet, progress: bool = True
) -> tuple[pd.DataFrame, list[Row], list[Path]]:
    """Run the missing episodes and report; return the records, the rows of the table, and all files.

    maps: the job's map set. progress: show a bar.
    """
    run_dir = job.run_dir
    # Drive what the records lack.
    drive(job.config, run_labels(job, maps), maps, run_dir, progress)
    # Make the pages that `explain` asks for.
    pages.make_requested_pages(
        job.config.explain, run_dir, instantiate.build(job.config.executor, "executor")
    )
    # Write tables and pictures from the records alone.
    frame, rows, artifacts = report(maps, job)
    return frame, rows, [*artifacts, *_film(job.config, maps, run_dir), *failures.folder(run_dir)]


def drive(
    config: EpisodesConfig, labels: RunLabels, maps: MapSet, run_dir: Path, progress: bool = True
) -> None:
    """Run the missing episodes of map set × runs into the records of `run_dir`. progress: show a bar."""
    executor = instantiate.build(config.executor, "executor")
    with (
        RecordWriter(run_dir) as writer,
        EpisodeProgress(labels.system, len(maps.numbers) * config.runs, progress) as bar,
    ):
        # Skip the episodes of an earlier run, and append each result to the log as it comes.
        driven_keys = writer.done()
        bar.skip(len(driven_keys))
        if driven_keys:
            labels = _recorded(labels, run_dir)
        payload = EpisodePayload(config, labels, _recordings(config, run_dir))
        remaining_keys = (key for key in _by_run(maps, config.runs) if key not in driven_keys)
        for result in executor.map(initialise, payload, remaining_keys):
            writer.append(result)
            bar.add(result.record.outcome)
        writer.merge()


def _recorded(labels: RunLabels, run_dir: Path) -> RunLabels:
    """Return the labels of the run's records: a resumed run keeps its names, even if files in `conf/` changed."""
    episode = read_episodes([run_dir]).iloc[0].dropna()
    return RunLabels(**{key: str(episode.get(key, label)) for key, label in asdict(labels).items()})


def report(maps: MapSet, job: Job[EvalConfig]) -> tuple[pd.DataFrame, list[Row], list[Path]]:
    """Write tables and picture from the records alone; return the records, the table's rows, and all files."""
    from runners.reports.analysis.summary import summarise
    from runners.reports.analysis.tables import write_tables
    from runners.reports.figures.paths import draw_run

    run_dir = job.run_dir
    frame = read_episodes([run_dir])
    rows = summarise(frame, systems=systems.systems(job.folders), labels=ablations.labels(job.folders))
    tables = write_tables(frame, rows, run_dir)
    picture = draw_run(frame, run_dir, maps, run_dir / "trajectories.png")
    return frame, rows, [*tables, *picture, run_dir / EPISODES]


def _film(config: EvalConfig, maps: MapSet, run_dir: Path) -> list[Path]:
    """Draw an animation of the first episode, if something moves in its world."""
    world = maps.numbers[0]
    if not maps.task(world).world.movers:
        return []
    from runners.reports.figures.animation import animate

    path = run_dir / "episode.gif"
    animate(config, world, 0, path)
    return [path]


def _recordings(config: EpisodesConfig, run_dir: Path) -> Recordings | None:
    """Return the directory and the config for recordings; None to write none."""
    if not isinstance(config, ReportConfig) or config.record is Record.none:
        return None
    return Recordings(run_dir / recorder.FOLDER, identity(config))


def _by_run(maps: MapSet, runs: int) -> Iterator[EpisodeKey]:
    """Yield the episodes run by run, so that a partial run covers the map set; they are never all in memory."""
    worlds = sorted(maps.numbers)
    return (EpisodeKey(world, run) for run in range(runs) for world in worlds)
