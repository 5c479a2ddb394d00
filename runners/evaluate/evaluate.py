"""`lme eval`: episodes of map set × runs become records, and records become tables, pictures and a tracked run."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lme.config.composer import CUSTOM
from lme.errors import InputError
from lme.worlds.world import DrawsRobots, MapSet, Named
from runners.config import build, instantiate, systems
from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.quoting import key_of, resume_command
from runners.config.schema import (
    DriveConfig,
    EpisodesConfig,
    EvalConfig,
    Explain,
    PictureConfig,
    Record,
    ReportConfig,
)
from runners.config.systems import System
from runners.records import launch_record, trust
from runners.records.episode_record import CUSTOM_SUBSET, EpisodeKey, RunLabels
from runners.records.parquet import EPISODES
from runners.records.records import RecordWriter, find_runs, read_episodes, read_first
from runners.reports.analysis import failures
from runners.reports.analysis.summary import Row, metrics, summarise
from runners.reports.analysis.tables import print_table, write_tables
from runners.reports.figures.style import PicturePage, drawn_on
from runners.tracking.tracking import Tracking, closed_by, parameters, short_names
from runners.workers.episodes import EpisodePayload, Recordings, initialise
from runners.workers.executor import ProcessExecutor, SerialConfig, SerialExecutor
from runners.workers.progress import EpisodeProgress, activity

if TYPE_CHECKING:
    import pandas as pd

DRAWN = "drawn"  # instead of a robot's name, if every episode has another robot


def evaluate(job: Job[EvalConfig], *, progress: bool = True, summary: bool = True) -> None:
    """Drive the missing episodes of a job, and write everything below its run directory.

    progress: show a bar. summary: print the table, where everything is, and after Ctrl-C how to go on.
    """
    # Build the worlds once, and open the tracked run.
    run_dir, maps = job.run_dir, build.map_set(job.config)
    labels = run_labels(job, maps)
    tracking: Tracking = instantiate.build(job.config.tracking, "tracking")
    tags = {**asdict(labels), "changes": job.changes_text, "command": "eval"}
    tracking.start(parameters(job, labels), run_dir, tags, job.sweep_dir)
    with closed_by(tracking):
        # Drive what the records lack; then write pages, tables and pictures from the records alone.
        with resume_hint("eval", run_dir) if summary else nullcontext():
            drive(job.config, labels, maps, run_dir, progress)
            if job.config.explain is not Explain.none:
                from runners.reports.explainer.pages import make_requested_pages

                executor = instantiate.build(job.config.executor, "executor")
                make_requested_pages(job.config.explain, run_dir, executor)
            with activity("Tables and pictures") if summary else nullcontext():
                frame, rows, artifacts = report(maps, job)
                artifacts += [*_film(job.config, maps, run_dir), *failures.folder(run_dir)]
        # Print the table, and where everything is.
        if summary:
            print_table(frame, rows)
            if limits := build.describe_limits(job.config, frame):
                print(limits)
            if pointer := failures.pointer(frame, run_dir):
                print(pointer)
            print(f"Records, tables and pictures: {run_dir}")
            for directory in failures.folder(run_dir):
                print(f"Why the robot went there: {directory / failures.INDEX}")
        tracking.finish(metrics(frame), artifacts)


def validate(job: Job[EvalConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    job.check_scale()
    check_report(job)
    maps = build.map_set(job.config)
    _check_drawn(job, maps)
    build.check_drive(job.config, maps=maps)


def _check_drawn(job: Job[EvalConfig], maps: MapSet) -> None:
    """Raise InputError for keys that a map set that draws a robot per episode cannot support, or does not use."""
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
    words = ((key_of(word), word.partition("=")[2]) for word in job.overrides)
    robot = {key: value for key, value in words if key == "robot"}
    for key, value in {**robot, **job.changes}.items():
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


def check_report(job: Job[ReportConfig]) -> None:
    """Raise InputError if a job cannot record or report as its config says."""
    config = job.config
    systems.check_names(config.table, job.folders)
    if config.record is Record.mcap:
        from runners.workers import mcap_episodes

        mcap_episodes.check_installed()
    instantiate.configured(config.tracking, "tracking")


def drive(
    config: EpisodesConfig, labels: RunLabels, maps: MapSet, run_dir: Path, progress: bool = True
) -> None:
    """Run the missing episodes of map set × runs into the records of `run_dir`. progress: show a bar."""
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
        executor = _executor(config, len(maps.numbers) * config.runs - len(driven_keys))
        # Run by run, so that a partial run covers the map set; the keys are never all in memory.
        worlds = sorted(maps.numbers)
        keys = (EpisodeKey(world, run) for run in range(config.runs) for world in worlds)
        remaining_keys = (key for key in keys if key not in driven_keys)
        for result in executor.map(initialise, payload, remaining_keys):
            writer.append(result)
            bar.add(result.record.outcome)
        writer.merge()


def _executor(config: EpisodesConfig, num_episodes: int) -> Any:
    """Return what runs the episodes: this process if they are few and the number of workers is left open.

    A user's own code always runs in a worker, since it may end its process.
    """
    executor = instantiate.build(config.executor, "executor")
    is_open = isinstance(executor, ProcessExecutor) and config.executor["workers"] is None
    is_short = is_open and num_episodes <= build.FEW_EPISODES and not any(trust.foreign(asdict(config)))
    return SerialExecutor(SerialConfig()) if is_short else executor


def _recorded(labels: RunLabels, run_dir: Path) -> RunLabels:
    """Return the labels of the run's records: a resumed run keeps its names, even if files in `conf/` changed."""
    episode = read_first(run_dir)
    return RunLabels(**{key: str(episode.get(key, label)) for key, label in asdict(labels).items()})


def report(maps: MapSet, job: Job[EvalConfig]) -> tuple[pd.DataFrame, list[Row], list[Path]]:
    """Write tables and picture from the records alone; return the records, the table's rows, and all files."""
    from runners.reports.figures.paths import draw_run

    # One run needs no other name than that of its own system.
    run_dir, labels = job.run_dir, run_labels(job, maps)
    frame = read_episodes([run_dir])
    rows = summarise(frame, systems=_own_system(labels.guide, labels.planner, job))
    tables = write_tables(frame, rows, run_dir)
    with drawn_on(page_of(job.config)):
        picture = draw_run(frame, run_dir, maps, run_dir / "trajectories.png")
    return frame, rows, [*tables, *picture, run_dir / EPISODES]


def _film(config: EvalConfig, maps: MapSet, run_dir: Path) -> list[Path]:
    """Draw an animation of the first episode, if something moves in its world."""
    world = maps.numbers[0]
    if not maps.task(world).world.movers:
        return []
    from runners.reports.figures.animation import animate

    path = run_dir / "episode.gif"
    animate(config, world, path)
    return [path]


def _recordings(config: EpisodesConfig, run_dir: Path) -> Recordings | None:
    """Return the directory and the config for recordings; None to write none."""
    if not isinstance(config, ReportConfig) or config.record is Record.none:
        return None
    from runners.workers import mcap_episodes

    return Recordings(run_dir / mcap_episodes.FOLDER, launch_record.identity(config))


def run_labels(job: Job[DriveConfig], maps: MapSet) -> RunLabels:
    """Return the names of system, robot and map for all records of the job. maps: the job's map set."""
    config = job.config
    guide, planner = _option_label("guide", job), _option_label("planner", job)
    system = next(iter(_own_system(guide, planner, job).values()), None)
    has_changes = any(key.startswith(("guide.", "planner.")) for key in job.changes)
    # The user may have named the system; the file of a system names its own pair.
    chosen, catalogue = job.choices.get("system", ""), Catalogue(job.folders)
    own_label = systems.own_label(config.system.label, chosen, catalogue)
    return RunLabels(
        system=own_label or systems.label(guide, planner, system, has_changes),
        guide=guide,
        planner=planner,
        global_map=str(config.guide.get("global_map", "")),
        # Several options are joined by +. If a file chooses several, the parameters that they set are named.
        ablation=job.choices.get("ablation") or systems.SEVERAL.join(config.ablation),
        weights=job.weights,
        robot=DRAWN if isinstance(maps, DrawsRobots) else config.robot.name,
        map=maps.name if isinstance(maps, Named) else job.choices["map"],
        subset=CUSTOM_SUBSET if config.map.get("worlds") else str(config.map.get("subset", "")),
        people=str(build.people_of(config)),
    )


def _own_system(guide: str, planner: str, job: Job[DriveConfig]) -> dict[str, System]:
    """Return the system of the job's pair by its name; {} for a pair without a name."""
    return systems.system_of(guide, planner, job.folders, job.choices.get("system", ""))


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


def page_of(config: object) -> PicturePage:
    """Return the page of the pictures of a command; `lme eval` and `lme figure` let the user set it."""
    picture = getattr(config, "picture", PictureConfig())
    return PicturePage(picture.title, picture.caption, getattr(picture, "width", None))


class SweepReport(NamedTuple):
    """Files that were written, and the lines to print below the table."""

    files: list[Path]
    lines: list[str]


def finish_sweep(job: Job[ReportConfig], run_dirs: Sequence[Path]) -> None:
    """Tabulate, draw, print and track all runs of a sweep. job: the first one."""
    run_dirs = find_runs(run_dirs)
    frame = read_episodes(run_dirs)
    sweep_dir = job.sweep_dir
    assert sweep_dir is not None
    rows = summarise(frame, job.config.table, systems.systems(job.folders))
    with activity("Tables and pictures of the sweep"), drawn_on(page_of(job.config)):
        artifacts, lines = report_runs(frame, rows, run_dirs, sweep_dir)
    print_table(frame, rows)
    for line in lines:
        print(line)
    print(f"The sweep's table and pictures: {sweep_dir}")
    _track(job, frame, artifacts, sweep_dir, run_dirs)


def report_runs(
    frame: pd.DataFrame, rows: Sequence[Row], run_dirs: Sequence[Path], folder: Path
) -> SweepReport:
    """Write the table and pictures of several runs into `folder`, and the studies that the records allow.

    frame: their records. rows: those of their table.
    """
    from runners.reports.analysis.comparison import comparison_figure
    from runners.reports.figures.trajectories import side_by_side_figure

    files = [
        *write_tables(frame, rows, folder),
        *comparison_figure(frame, rows, folder),
        *side_by_side_figure(frame, run_dirs, folder),
    ]
    studied = _studies(frame, folder)
    return SweepReport(files + studied.files, studied.lines)


def _studies(frame: pd.DataFrame, folder: Path) -> SweepReport:
    """Write the studies of systems, ablations, scales and values of a key, if the records have any."""
    from runners.reports.analysis import study
    from runners.reports.analysis.ablation import AblationStudy
    from runners.reports.analysis.comparison import Comparison
    from runners.reports.analysis.curves import CurveStudy
    from runners.reports.analysis.sensitivity import SensitivityStudy

    kinds: tuple[type[study.SweepStudy], ...] = (Comparison, AblationStudy, SensitivityStudy, CurveStudy)
    files: list[Path] = []
    lines: list[str] = []
    for kind in kinds:
        studies = kind.studies(frame)
        if studies:
            files += study.write(studies, folder)
            lines += [line for sweep_study in studies for line in sweep_study.sentences()]
    return SweepReport(files, lines)


def _track(
    job: Job[ReportConfig],
    frame: pd.DataFrame,
    artifacts: Sequence[Path],
    sweep_dir: Path,
    run_dirs: Sequence[Path],
) -> None:
    """Track the sweep: the config that its jobs share, its table and its pictures. The jobs have the metrics."""
    launches = {run_dir: record for run_dir in run_dirs if (record := launch_record.read_launch(run_dir))}
    shared = launch_record.common([record.configs[0] for record in launches.values()])
    rows = frame.drop_duplicates("run_dir").set_index("run_dir")
    names = [
        short_names(rows.loc[str(run_dir)].to_dict(), job.folders, record.choices[0].get("system", ""))
        for run_dir, record in launches.items()
    ]
    tracking = instantiate.build(job.config.tracking, "tracking")
    tracking.start({**shared, **launch_record.common(names)}, sweep_dir, {"command": "sweep"})
    with closed_by(tracking):
        tracking.finish({}, artifacts)
