"""Opening of a recorded episode, from a run of `lme eval`, a run saved from the page, or a recording; or of a map.

The map of a place where a real robot drove is built from the log of its drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError
from lme.guides.lme.weight_files import PUBLISHED
from lme.types import Floats, Outcome
from lme.worlds.world import Task
from runners.config import build
from runners.config.schema import DriveConfig, RecordedConfig
from runners.play.saving import FOLDER, SCRIPT, read_script
from runners.play.session import Entrant, Script, Session, Setup, Source
from runners.play.setups import explicit
from runners.play.simulation_track import SimulationTrack
from runners.records import inputs, trust
from runners.records.episode_record import EpisodeKey, RunLabels
from runners.records.launch_record import LAUNCH, Launch, read_launch
from runners.workers.trace import another_path, is_same_drive

if TYPE_CHECKING:
    import pandas as pd


BEFORE_S = 3.0  # how long before a collision the page opens
_RECORDINGS = (".bag", ".db3")


def open_episode(path: Path, word: str | None, step: int | None) -> Session:
    """Return the session of a recorded episode, driven to its end and shown at a step.

    path: of a run's directory or of an .mcap recording by `lme eval`. word: "WORLD/RUN"; None for the first failed
    episode, or the first of all. step: None for the step where it went wrong. Raises InputError.
    """
    session = _of_recording(path) if path.suffix.lower() == ".mcap" else _of_run(path, word)
    (lane,) = session.lanes
    last_step = len(lane.frames) - 1
    if step is not None and step > last_step:
        raise InputError(f"--step {step}: must be at most {last_step}, the last step of the episode")
    session.shown = _telling_step(lane) if step is None else step
    return session


def _of_run(run_dir: Path, word: str | None) -> Session:
    from runners.records.records import find_runs, read_episodes, read_record, read_trajectories
    from runners.reports.explainer.pages import keys_of, select_episodes

    # Check that the directory holds exactly one run, and choose the episode.
    find_runs([run_dir])
    launch = read_launch(run_dir)
    if launch is None:
        raise InputError(f"{run_dir}: has no {LAUNCH}, so its episodes cannot be played")
    if launch.multirun:
        raise InputError(f"{run_dir} holds several runs: give one of them, such as {run_dir / '0'}")
    episodes = read_episodes([run_dir])
    key = keys_of(select_episodes(episodes, [word]))[0] if word else _first_failed(episodes)
    # Drive the episode again, and make sure that it is the recorded one.
    labels = RunLabels(**{name: str(episodes.iloc[0].get(name, "")) for name in RunLabels.__annotations__})
    session = _replay_script(_setup(launch, run_dir, labels, key), run_dir / SCRIPT)
    steps, drive = read_trajectories([run_dir], [key]), session.lanes[0].episode()
    if drive is None or not is_same_drive(drive, steps, read_record(run_dir, key)):
        raise another_path(run_dir, key)
    return session


def _of_recording(path: Path) -> Session:
    from runners.recordings.bags import Bag
    from runners.recordings.own_recordings import episode_of

    with Bag(path) as bag:
        episode = episode_of(bag)
    if episode is None or episode.live:
        raise InputError(f"{path}: only an episode of lme eval record=mcap can be played: its world is known")
    config = episode.config
    labels = RunLabels(**dict.fromkeys(RunLabels.__annotations__, ""))
    task = _task(config, episode.world)
    entrant = Entrant(config, "recorded", (), labels)
    return _replay_script(Setup((entrant,), task, episode.run, None, (episode.world,)), None)


def _setup(launch: Launch, run_dir: Path, labels: RunLabels, key: EpisodeKey) -> Setup:
    config = launch.config
    words = _words(launch, run_dir, config)
    config_dirs = launch.folders[1:]
    source = Source(
        (*words, f"map.worlds=[{key.world}]", f"run={key.run}"),
        config_dir=config_dirs[0] if config_dirs else None,
    )
    numbers = tuple(build.map_set(config).numbers)
    return Setup(
        (Entrant(config, labels.system, words, labels),), _task(config, key.world), key.run, source, numbers
    )


def _words(launch: Launch, run_dir: Path, config: RecordedConfig) -> tuple[str, ...]:
    """Return the words from which the page composes the run's config again. Raises UntrustedError."""
    # Let the paths lead to the run's own copies of files.
    recorded = {**launch.changes[0], "guide.weights": config.weights}
    changes = inputs.located(recorded, launch.inputs, run_dir)
    weights = changes.pop("guide.weights")
    trust.check_config(recorded, run_dir)
    # Check the words, and the weights, unless they lead to such a copy.
    others = {
        key: value for key, value in changes.items() if value == recorded[key]
    }  # without paths of copies
    trust.check_words(explicit(launch.choices[0], others, replace(config, weights=PUBLISHED)), run_dir)
    if weights == config.weights:
        trust.check_words([f"weights={weights}"], run_dir)
    return explicit(launch.choices[0], changes, replace(config, weights=weights))


def _replay_script(setup: Setup, script: Path | None) -> Session:
    """Return the session of a setup, driven to its end, with the changes of a script file if there is one."""
    session = Session(setup)
    if script is not None and script.is_file():
        session.play(Script(setup, read_script(script, setup.task)))
    session.advance(10**9, budget_s=600.0)
    return session


def _task(config: DriveConfig, world: int) -> Task:
    return build.map_set(config, [world]).task(world)


def _first_failed(episodes: pd.DataFrame) -> EpisodeKey:
    from runners.reports.analysis.failures import is_failure
    from runners.reports.explainer.pages import keys_of

    failed = episodes[is_failure(episodes)]
    return keys_of(failed if len(failed) else episodes)[0]


def _telling_step(lane: SimulationTrack) -> int:
    """Return the step where it went wrong: shortly before a collision, or nearest to the goal before a timeout."""
    last_step, targets = len(lane.frames) - 1, [frame.moment.observation.target for frame in lane.frames]
    if lane.outcome is Outcome.COLLISION:
        return max(0, last_step - round(BEFORE_S / lane.config.robot.dt))
    if lane.outcome is Outcome.TIMEOUT:
        return int(np.argmin(np.hypot(*np.transpose(targets))))
    return 0


def words_of(argv: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split the words into those that name an episode and the others, which are overrides and flags."""
    paths: list[str] = []
    options: list[str] = []
    for word in argv:
        (options if "=" in word or word.startswith("-") or options else paths).append(word)
    return paths, options


def is_log(path: Path) -> bool:
    """Return whether a path is the log of a drive, not a run or an episode of `lme eval`. Raises InputError."""
    from runners.recordings.bags import Bag
    from runners.recordings.carmen import is_carmen
    from runners.recordings.own_recordings import episode_of

    if path.suffix.lower() == ".mcap":
        with Bag(path) as bag:
            episode = episode_of(bag)
        return episode is None or episode.live
    if path.is_dir():
        return not (path / LAUNCH).exists() and any(path.glob("*.db3"))
    return path.suffix.lower() in _RECORDINGS or is_carmen(path)


def words_of_log(log: Path, root: Path = Path()) -> tuple[str, ...]:
    """Return words that open the map of a log, from where the robot started to the farthest place on its way.

    The map is written below `root`, as by `lme maps build`. Raises InputError.
    """
    from runners.recordings.map_build import BuildConfig, build_map, write_map

    built = build_map([log], BuildConfig())
    target = root / FOLDER / f"{log.resolve().name.partition('.')[0]}_map.yaml"
    write_map(built, target)
    print(f"map: {target}", flush=True)
    start = built.way[0]
    goal = built.way[np.argmax(np.hypot(*(built.way - start).T))]
    return (
        "map=file",
        f"map.path={target}",
        f"map.start={_point_text(start)}",
        f"map.goal={_point_text(goal)}",
    )


def _point_text(point: Floats) -> str:
    return f"[{point[0]:.3f},{point[1]:.3f}]"
