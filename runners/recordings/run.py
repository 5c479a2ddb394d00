"""`lme replay`: reads a recording, makes decisions on it, and writes the table, the figures and the pictures."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from lme.errors import InputError, require
from lme.inputs import plausibility
from lme.live.config import ScanConfig
from lme.live.frames import FramesConfig
from lme.live.messages import SECOND
from lme.live.scan_source import ScanSource
from lme.perception.people.source import People
from lme.robots import Robot
from runners.config import build, instantiate
from runners.config.changes import flatten
from runners.config.instantiate import configured, fill_dataclass
from runners.config.job import Job
from runners.config.quoting import key_of
from runners.config.schema import ReplayConfig
from runners.recordings import figures, own_recordings, report
from runners.recordings.bags import Bag
from runners.recordings.driver import Driver, goal_source, topic_of
from runners.recordings.recording import CLOCKS, Recording, inspect, open_recording
from runners.recordings.topics import BagTopicsConfig, choose
from runners.tracking.tracking import closed_by

_SLOWER = 0.9  # scans at less than this fraction of the robot's control rate set the rate of decisions


@dataclass(frozen=True, slots=True)
class _Section:
    """The part of the recording that is replayed [ns, clock of the file]."""

    start: int | None
    stop: int | None


def validate(job: Job[ReplayConfig]) -> None:
    """Raise InputError for a mistake in the config, or a recording without the topics that a replay needs."""
    config = job.config
    path = _path(config)
    if config.clock not in CLOCKS:
        raise InputError(f"clock is {config.clock}: must be one of {', '.join(CLOCKS)}")
    # Values that can be checked without the recording.
    for key in ("seed", "start"):
        require(key, getattr(config, key), at_least=0)
    if config.end is not None:
        require("end", config.end, above=config.start)
    for key in ("stale", "ahead", "horizon"):
        require(key, getattr(config, key), above=0.0)
    plausibility.check("stale", config.stale)
    configured(config.tracking, "tracking")
    if config.rerun:
        figures.check_rerun()
    # What the replay builds, then the topics of the recording.
    fill_dataclass(ScanConfig, config.scan, "scan")
    build.refuse_truth(config)
    build.navigator(config)
    with open_recording(path) as bag:
        choose(bag, fill_dataclass(BagTopicsConfig, config.topics, "topics"), topic_of(config.goal))


def replay(job: Job[ReplayConfig]) -> None:
    """Replay the recording and write all results into the run directory."""
    run_dir = job.run_dir
    if (run_dir / report.TABLE).exists():
        raise InputError(f"{run_dir}: already holds a replay: choose another directory")
    with ExitStack() as stack:
        bag = stack.enter_context(open_recording(_path(job.config)))
        episode = own_recordings.episode_of(bag) if job.config.as_recorded else None
        config = _as_recorded(job, episode)
        tracking = instantiate.build(config.tracking, "tracking")
        tags = {"command": "replay", "bag": bag.path.name}
        values = {**dict(flatten(asdict(config))), "robot": config.robot.name}
        tracking.start(values, run_dir, tags, job.sweep_dir)
        stack.enter_context(closed_by(tracking))
        results, artifacts = _replay(bag, config, episode, run_dir, stack)
        tracking.finish(results, artifacts)


def _path(config: ReplayConfig) -> Path:
    if not config.bag:
        raise InputError("bag is null: give the recording, e.g. lme replay drive.mcap")
    return Path(config.bag)


def _replay(
    bag: Bag,
    config: ReplayConfig,
    episode: own_recordings.RecordedEpisode | None,
    run_dir: Path,
    stack: ExitStack,
) -> tuple[dict[str, float], list[Path]]:
    """Replay the recording and write the results; return the figures and the paths of the files."""
    # Find out what the recording holds, and build the lidar's view of it and the navigator.
    recording, section = _recording(bag, config, episode)
    stale = round(config.stale * SECOND)
    scan_source = ScanSource(
        fill_dataclass(ScanConfig, config.scan, "scan"),
        recording.first_scan.content,
        recording.mount,
        config.robot if episode is not None else _at_scan_rate(config, recording),
        recording.carrier,
    )
    navigator = build.navigator(config, scan_source.robot)

    # A driver begins anew, with the random numbers of the episode if lme made the recording.
    def driver() -> Driver:
        seed = np.random.default_rng(np.random.SeedSequence([config.seed]))
        navigator.reset(seed if episode is None else episode.rng())
        if episode is not None:
            episode.read_map(navigator)
        goal = goal_source(config.goal, recording, section.stop, stale)
        every_scan = episode is not None
        return Driver(recording, scan_source, navigator, goal, config.horizon, stale, every_scan)

    # Drive once to load compiled code, then for the results.
    _warm_up(driver(), recording, section)
    driving = driver()
    artifacts = []
    if config.rerun:
        file = stack.enter_context(
            figures.RerunFile(run_dir / "replay.rrd", recording.bag.path.name, scan_source.robot)
        )
        driving.listen(file.show)
        artifacts.append(file.path)
    start_s = perf_counter()
    for message in bag.messages(recording.topics.names, section.start, section.stop):
        driving.take(message)
    log = driving.finish()
    wall_s = perf_counter() - start_s
    # Write the table, the figures of agreement, and the pictures.
    frame = report.replay_table(log, scan_source.robot.dt, config.ahead)
    results = report.figures(frame, log, scan_source.robot.dt, wall_s)
    artifacts += report.write(frame, results, run_dir)
    artifacts += figures.write(frame, log, scan_source, recording, run_dir)
    _print_results(recording, scan_source, episode, results, config.ahead, run_dir)
    return results, artifacts


def _recording(
    bag: Bag, config: ReplayConfig, episode: own_recordings.RecordedEpisode | None
) -> tuple[Recording, _Section]:
    requested = own_recordings.GOAL if episode is not None and config.goal is None else topic_of(config.goal)
    names = fill_dataclass(BagTopicsConfig, config.topics, "topics")
    if episode is not None and names.command is None:
        names.command = episode.command
    topics = choose(bag, names, requested)
    recording = inspect(bag, topics, fill_dataclass(FramesConfig, config.frames, "frames"), config.clock)
    start = bag.start + round(config.start * SECOND) if config.start else None
    stop = None if config.end is None else bag.start + round(config.end * SECOND)
    return recording, _Section(start, stop)


def _at_scan_rate(config: ReplayConfig, recording: Recording) -> Robot:
    """Return the robot, with its control rate reduced to the rate of the scans if they are less frequent."""
    slowest = plausibility.USUAL["control_rate"].least
    if 0.0 < recording.scan_rate < slowest:
        raise InputError(
            f"bag {recording.bag.path}: its scans come every {1.0 / recording.scan_rate:.4g} s by their stamps: must "
            f"come at least every {1.0 / slowest:g} s; are the times in milliseconds?"
        )
    if 0.0 < recording.scan_rate < _SLOWER * config.robot.control_rate:
        return replace(config.robot, control_rate=recording.scan_rate)
    return config.robot


def _warm_up(driver: Driver, recording: Recording, section: _Section) -> None:
    """Make a few decisions that are not recorded, since the first ones load compiled code, which takes time."""
    for message in recording.bag.messages(recording.topics.names, section.start, section.stop):
        driver.take(message)
        if len(driver.log.rows) >= 3:
            return


def _as_recorded(job: Job[ReplayConfig], episode: own_recordings.RecordedEpisode | None) -> ReplayConfig:
    """Return the config with the recorded system and seed, if lme made the recording."""
    if episode is None:
        return job.config
    changed_keys = set(map(key_of, job.overrides))
    requested = sorted(
        key
        for key in changed_keys
        if key.partition(".")[0] in (*own_recordings.GROUPS, "weights", "ablation", "system")
    )
    if requested:
        raise InputError(
            f"{requested[0]}: lme made this recording, so it is replayed with its own robot, guide and planner; "
            "add as_recorded=false to choose others"
        )
    # Take over the system. Where people truly were is not known here: then this config says where they come from.
    groups = {group: getattr(episode.config, group) for group in own_recordings.GROUPS}
    recorded_people = episode.config.people
    people = job.config.people if recorded_people is People.truth else recorded_people
    return replace(job.config, **groups, people=people, seed=episode.seed)


def _print_results(
    recording: Recording,
    scan_source: ScanSource,
    episode: own_recordings.RecordedEpisode | None,
    results: Mapping[str, float],
    ahead: float,
    run_dir: Path,
) -> None:
    """Print what was read, and the results."""
    topics, lidar = recording.topics, scan_source.robot.lidar
    command = topics.command.name if topics.command else "none"
    poses = f"{topics.pose_name} ({recording.frames.odom} to {recording.frames.base})"
    print(f"topics   scans {topics.scan.name}, poses {poses}, commands {command}")
    fov = f"{np.degrees(lidar.fov):.0f}°"
    print(f"lidar    {lidar.num_beams} beams over {fov}, mounted as {scan_source.mounted_by} says")
    if episode is not None:
        print(
            f"episode  {episode}, as it was driven; "
            f"{100 * results['same_command']:.0f} % of the commands are the recorded ones to the last bit"
        )
    print("\n".join(report.lines(results, ahead)))
    print(f"Table, figures and pictures: {run_dir}")
