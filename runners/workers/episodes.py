"""Run the episodes of a config and make their records. Worker processes call this module."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from lme import metrics
from lme.errors import InputError
from lme.navigation.episode import Episode, Observer, run_episode
from lme.navigation.navigator import Navigator
from lme.robots import Robot
from lme.simulation.contact_side import contact_side
from lme.simulation.simulator import Simulator, State
from lme.simulation.social import Company, without_people
from lme.types import Guidance, Observation, Outcome, Twist
from lme.worlds.check import check_task
from lme.worlds.world import DrawsRobots, Task
from runners.config import build
from runners.config.schema import DriveConfig
from runners.records.episode_record import EpisodeKey, EpisodeRecord, EpisodeResult, RunLabels


@dataclass(frozen=True, slots=True)
class Recordings:
    """Directory of the recordings, and the part of the config that decides results, which each recording contains."""

    folder: Path
    config: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class EpisodePayload:
    """Everything that a worker needs to drive the episodes of a run. recordings: None to write none."""

    config: DriveConfig
    labels: RunLabels
    recordings: Recordings | None


def initialise(payload: EpisodePayload) -> Callable[[EpisodeKey], EpisodeResult]:
    """Build everything once per process; return the function that runs one episode. Raises InputError."""
    seed, recordings = payload.config.seed, payload.recordings
    # On a cluster, a machine may not have the run's directory.
    if recordings is not None and not recordings.folder.parent.is_dir():
        raise InputError(
            f"record=mcap: {recordings.folder.parent.absolute()} does not exist on {platform.node()}: start the "
            "workers in the folder in which lme was called, on a file system that the machines share"
        )
    # Build the worlds, navigator and simulator; the last two for every episode if the map set draws robots.
    maps = build.map_set(payload.config)
    own = None if isinstance(maps, DrawsRobots) else _system(payload.config)
    # Drive a short episode that is not recorded: the first decisions load compiled code, which takes time.
    config, task, _ = build.setting(payload.config, maps, maps.numbers[0])
    short = replace(task, time_limit=2 * config.robot.dt)
    run_episode(short, *(own or _system(config)), np.random.default_rng(0))

    def run(key: EpisodeKey) -> EpisodeResult:
        start_s = perf_counter()
        config, task, disturbances = build.setting(payload.config, maps, key.world)
        robot = config.robot
        check_task(task, robot)
        navigator, simulator = own or _system(config)
        # Drive, with observers for the recording and for the social measures, if wanted.
        company = Company(robot, simulator) if task.world.people else None
        with _recorder(recordings, seed, key, robot) as recorder:
            observers = [observer for observer in (recorder, company) if observer is not None]
            rng = episode_rng(seed, key.world, key.run)
            observer = _Observers(observers) if observers else None  # telling one the state takes time
            episode = with_contact_side(
                run_episode(task, navigator, simulator, rng, observer), robot, simulator
            )
        record = record_of(payload.labels, key, seed, task, episode, perf_counter() - start_s)
        # Social measures compare with a second drive, from the same random numbers but without people.
        if company is not None:
            rng = episode_rng(seed, key.world, key.run)
            drive_alone = partial(run_episode, without_people(task), navigator, simulator, rng)
            record = replace(record, social=_social(company, episode, drive_alone))
        if disturbances:
            record = replace(record, world_measures={**record.world_measures, **disturbances})
        return EpisodeResult(record, episode.trajectory)

    return run


def with_contact_side(episode: Episode, robot: Robot, simulator: Simulator) -> Episode:
    """Return the episode that has just ended, with the side of the robot that collided if no part is known."""
    if episode.outcome is not Outcome.COLLISION or episode.contact_part:
        return episode
    side = contact_side(simulator.state.pose, robot.footprint.box, *simulator.obstacles)
    return replace(episode, contact_part=side)


def _system(config: DriveConfig) -> tuple[Navigator, Simulator]:
    return build.navigator(config), build.simulator(config)


class _Observers:
    """Several observers of one episode, notified in turn."""

    def __init__(self, observers: Sequence[Observer]) -> None:
        self._observers = observers

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        for observer in self._observers:
            observer.decided(observation, guidance, command, state)

    def ended(self, observation: Observation, state: State) -> None:
        for observer in self._observers:
            observer.ended(observation, state)


def episode_rng(seed: int, world: int, run: int) -> np.random.Generator:
    """Return the only source of randomness of an episode; `run_episode` first spawns the navigator's from it."""
    return np.random.default_rng(np.random.SeedSequence([seed, world, run]))


def _recorder(
    recordings: Recordings | None, seed: int, key: EpisodeKey, robot: Robot
) -> AbstractContextManager[Observer | None]:
    """Return the recorder of the episode; a null context if no recordings are written."""
    if recordings is None:
        return nullcontext()
    from runners.workers.mcap_episodes import Recorder, recording_path

    metadata = {"seed": seed, "world": key.world, "run": key.run, "config": recordings.config}
    return Recorder(recording_path(recordings.folder, key), metadata, robot)


def _social(company: Company, episode: Episode, drive_alone: Callable[[], Episode]) -> dict[str, float]:
    """Return the social measures by name. A successful episode is driven again without people, for its time alone."""
    measures: dict[str, float] = asdict(company.measures())
    if episode.outcome is Outcome.SUCCESS:
        solo_episode = drive_alone()
        if solo_episode.outcome is Outcome.SUCCESS and solo_episode.time > 0.0:
            measures["time_against_alone"] = episode.time / solo_episode.time
    return measures


def record_of(
    labels: RunLabels, key: EpisodeKey, seed: int, task: Task, episode: Episode, wall_s: float
) -> EpisodeRecord:
    """Return the record of an episode in a task, without the social measures. wall_s: how long it took [s]."""
    # An episode that starts at the goal has no decisions.
    decision_us = episode.decision_us if episode.steps else np.array([np.nan])
    success = episode.outcome is Outcome.SUCCESS
    shortest = task.shortest_path_length
    return EpisodeRecord(
        **asdict(labels),
        world=key.world,
        run=key.run,
        seed=seed,
        outcome=str(episode.outcome),
        time_s=episode.time,
        optimal_time_s=task.optimal_time,
        barn_metric=metrics.barn_metric(success, episode.time, task.optimal_time),
        path_length_m=episode.path_length,
        shortest_path_length_m=shortest,
        spl=metrics.spl(success, shortest, episode.path_length),
        steps=episode.steps,
        switches=episode.switches,
        no_free_candidate=episode.no_free_candidate,
        mean_abs_domega_radps=metrics.mean_abs_domega(episode.turn_rates),
        min_clearance_m=episode.min_clearance,
        final_distance_m=episode.final_distance,
        last_minute_m=metrics.last_extent(episode.trajectory[:, 0], episode.trajectory[:, 1:3]),
        reversals=metrics.reverse_starts(episode.speeds),
        collision_in_reverse=int(
            episode.outcome is Outcome.COLLISION and episode.speeds[-1] < -metrics.REVERSE_MPS
        ),
        contact_part=episode.contact_part,
        start_x_m=task.start.x,
        start_y_m=task.start.y,
        start_yaw_rad=task.start.yaw,
        goal_x_m=float(task.goal[0]),
        goal_y_m=float(task.goal[1]),
        goal_tolerance_m=task.goal_tolerance,
        decision_us_p50=float(np.percentile(decision_us, 50)),
        decision_us_p99=float(np.percentile(decision_us, 99)),
        wall_s=wall_s,
        world_measures=task.measures,
    )
