"""Replay one composed config: a recording to decisions, decisions to a table, figures, pictures, a tracked run."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from lme.errors import InputError, require
from lme.robots import Robot
from runners.config import build, systems
from runners.config.instantiate import build as build_target
from runners.config.instantiate import configured, filled
from runners.experiments.evaluate import sweep_directory
from runners.replay import report, simulated
from runners.replay.bags import Bag
from runners.replay.driver import Driver
from runners.replay.goals import goal_of, topic_of
from runners.replay.recording import CLOCKS, SECOND, FramesConfig, Recording, look
from runners.replay.scan_source import Eyes, ScanConfig
from runners.replay.topics import TopicsConfig, choose

_SLOWER = 0.9  # scans that come at less than this share of the robot's rate set the pace


@dataclass(frozen=True, slots=True)
class _Part:
    """What of the recording is replayed [ns of its clock]."""

    start: int | None
    stop: int | None


def validate(config: DictConfig) -> None:
    """Raise InputError for what can be known to be wrong before anything runs: the recording is opened, too."""
    if not config.bag:
        raise InputError("bag is null: give the recording, e.g. lme replay bag=drive.mcap")
    systems.check_implemented(config.system or {})
    if config.clock not in CLOCKS:
        raise InputError(f"clock is {config.clock}: must be one of {', '.join(CLOCKS)}")
    for key in ("seed", "start"):
        require(key, config[key], at_least=0)
    if config.end is not None:
        require("end", config.end, above=config.start)
    for key in ("stale", "ahead", "horizon"):
        require(key, config[key], above=0.0)
    configured(config.tracking, "tracking")
    if config.rerun:
        from runners.replay.rerun_file import check_installed

        check_installed()
    plain = build.plain(config)
    filled(ScanConfig, plain["scan"], "scan")
    build.navigator(plain, build.robot(plain))
    with Bag(Path(config.bag)) as bag:
        choose(bag, filled(TopicsConfig, plain["topics"], "topics"), topic_of(plain["goal"]))


def replay(config: DictConfig, run_dir: Path) -> None:
    """Replay the recording and write everything below `run_dir`."""
    plain = build.plain(config)
    if (run_dir / report.TABLE).exists():
        raise InputError(f"{run_dir}: already holds a replay: choose another directory")
    with ExitStack() as stack:
        bag = stack.enter_context(Bag(Path(plain["bag"])))
        episode = simulated.episode_of(bag) if plain["as_recorded"] else None
        plain = _as_recorded(plain, episode)
        tracking = build_target(plain["tracking"], "tracking")
        tracking.start(plain, run_dir, {"command": "replay", "bag": bag.path.name}, sweep_directory())
        found, artifacts = _replay(bag, plain, episode, run_dir, stack)
    tracking.finish(found, artifacts)


def _replay(
    bag: Bag, plain: Mapping[str, Any], episode: simulated.Episode | None, run_dir: Path, stack: ExitStack
) -> tuple[dict[str, float], list[Path]]:
    """Figures and files."""
    from runners.replay import figures

    recording, part = _recording(bag, plain, episode)
    stale = round(plain["stale"] * SECOND)
    eyes = Eyes(filled(ScanConfig, plain["scan"], "scan"), recording, _paced(plain, recording))
    navigator = build.navigator(plain, eyes.robot)

    def driver() -> Driver:
        seed = np.random.default_rng(np.random.SeedSequence([plain["seed"]]))
        navigator.reset(seed if episode is None else episode.rng())
        if episode is not None:
            episode.read_map(navigator)
        goal = goal_of(plain["goal"], recording, part.stop, stale)
        return Driver(recording, eyes, navigator, goal, plain["horizon"], stale)

    _warm_up(driver(), recording, part)
    driving = driver()
    artifacts = []
    if plain["rerun"]:
        from runners.replay.rerun_file import RerunFile

        file = stack.enter_context(RerunFile(run_dir / "replay.rrd", recording.bag.path.name, eyes.robot))
        driving.listen(file.show)
        artifacts.append(file.path)
    began = perf_counter()
    for message in bag.messages(recording.topics.names, part.start, part.stop):
        driving.take(message)
    log = driving.finish()
    wall_s = perf_counter() - began
    frame = report.frame_of(log, eyes.robot.dt, plain["ahead"])
    found = report.figures(frame, log, eyes.robot.dt, wall_s)
    artifacts += report.write(frame, found, run_dir)
    artifacts += figures.write(frame, log, eyes, recording, run_dir)
    _tell(recording, eyes, episode, found, run_dir)
    return found, artifacts


def _recording(
    bag: Bag, plain: Mapping[str, Any], episode: simulated.Episode | None
) -> tuple[Recording, _Part]:
    asked = simulated.GOAL if episode is not None and plain["goal"] is None else topic_of(plain["goal"])
    topics = choose(bag, filled(TopicsConfig, plain["topics"], "topics"), asked)
    recording = look(bag, topics, filled(FramesConfig, plain["frames"], "frames"), plain["clock"])
    start = bag.start + round(plain["start"] * SECOND) if plain["start"] else None
    stop = None if plain["end"] is None else bag.start + round(plain["end"] * SECOND)
    return recording, _Part(start, stop)


def _paced(plain: Mapping[str, Any], recording: Recording) -> Robot:
    """The robot; where scans come more slowly than it decides, at their pace, for without one there is no decision."""
    robot = build.robot(plain)
    if 0.0 < recording.scan_rate < _SLOWER * robot.control_rate:
        robot.control_rate = recording.scan_rate
    return robot


def _warm_up(driver: Driver, recording: Recording, part: _Part) -> None:
    """Some decisions that nobody counts: first ones load compiled code, and would spoil the timings."""
    for message in recording.bag.messages(recording.topics.names, part.start, part.stop):
        driver.take(message)
        if len(driver.log.rows) >= 3:
            return


def _as_recorded(plain: dict[str, Any], episode: simulated.Episode | None) -> dict[str, Any]:
    """The config with the system that drove in the recording, where it says so."""
    if episode is None:
        return plain
    chosen = {o.lstrip("+").partition("=")[0] for o in HydraConfig.get().overrides.task}
    asked = sorted(
        key for key in chosen if key.partition(".")[0] in (*simulated.GROUPS, "weights", "ablation", "system")
    )
    if asked:
        raise InputError(
            f"{asked[0]}: the recording is of lme eval and brings its own robot, guide and planner; "
            "add as_recorded=false to choose others"
        )
    return {**plain, **{group: episode.config[group] for group in simulated.GROUPS}, "seed": episode.seed}


def _tell(
    recording: Recording,
    eyes: Eyes,
    episode: simulated.Episode | None,
    found: Mapping[str, float],
    run_dir: Path,
) -> None:
    """What was read, and what came of it."""
    topics, lidar = recording.topics, eyes.robot.lidar
    command = topics.command.name if topics.command else "none"
    poses = f"{topics.pose_name} ({recording.odom} to {recording.base})"
    print(f"topics   scans {topics.scan.name}, poses {poses}, commands {command}")
    fov = f"{np.degrees(lidar.fov):.0f}°"
    print(f"lidar    {lidar.num_beams} beams over {fov}, mounted as {eyes.mounted_by} says")
    if episode is not None:
        print(
            f"episode  world {episode.world}, run {episode.run}, seed {episode.seed} of lme eval, as it was driven; "
            f"{100 * found['same_command']:.0f} % of the commands are the recorded ones to the last bit"
        )
    print("\n".join(report.lines(found)))
    print(f"Table, figures and pictures: {run_dir}")
