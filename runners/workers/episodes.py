"""One episode from a config, as a record: what worker processes do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lme import metrics
from lme.episode import TRAJECTORY_COLUMNS, Episode, Observer, run_episode
from lme.navigator import Navigator
from lme.robots import Robot
from lme.sim.simulator import Simulator
from lme.types import Outcome
from lme.worlds.check import check_task
from lme.worlds.world import Task
from runners.config import build
from runners.workers.recorder import Recorder, recording_path

Item = tuple[int, int]  # (world, run)
Result = tuple[dict[str, Any], dict[str, NDArray[Any]]]


def initialise(payload: Mapping[str, Any]) -> Callable[[Item], Result]:
    """Build everything once per process.

    payload: {"config": plain config, "names": record columns, "recordings": None, or as _recorder takes it}.
    """
    config, names = payload["config"], payload["names"]
    robot = build.robot(config)
    maps = build.map_set(config)
    navigator = build.navigator(config, robot)
    simulator = build.simulator(config, robot)

    _warm_up(replace(maps.task(maps.numbers[0]), time_limit=2 * robot.dt), navigator, simulator)

    def run(item: Item) -> Result:
        world, run_number = item
        began = perf_counter()
        task = maps.task(world)
        check_task(task, robot)
        rng = episode_rng(config["seed"], world, run_number)
        with _recorder(payload["recordings"], config["seed"], item, robot) as observer:
            episode = run_episode(task, navigator, simulator, rng, observer)
        record = {**names, "world": world, "run": run_number, "seed": config["seed"]}
        record |= _measure(task, episode)
        record["wall_s"] = perf_counter() - began
        columns = zip(TRAJECTORY_COLUMNS, episode.trajectory.T, strict=True)
        return record, {name: np.ascontiguousarray(values) for name, values in columns}

    return run


def episode_rng(seed: int, world: int, run: int) -> np.random.Generator:
    """The one source of an episode's randomness; `run_episode` spawns the navigator's stream from it first."""
    return np.random.default_rng(np.random.SeedSequence([seed, world, run]))


def _recorder(
    recordings: Mapping[str, Any] | None, seed: int, item: Item, robot: Robot
) -> AbstractContextManager[Observer | None]:
    """Who writes the episode's recording: nobody, or into {"folder": path, "config": what /lme tells of it}."""
    if recordings is None:
        return nullcontext()
    world, run = item
    about = {"seed": seed, "world": world, "run": run, "config": recordings["config"]}
    return Recorder(recording_path(Path(recordings["folder"]), world, run), about, robot)


def _warm_up(task: Task, navigator: Navigator, simulator: Simulator) -> None:
    """A short episode that nobody counts: first decisions load compiled code, and would spoil the timings."""
    run_episode(task, navigator, simulator, np.random.default_rng(0))


def _measure(task: Task, episode: Episode) -> dict[str, Any]:
    """The figures of one episode; units in the names."""
    decision_us = episode.decision_us if episode.steps else np.array([np.nan])  # it began at its end
    success = episode.outcome is Outcome.SUCCESS
    shortest = task.shortest_path_length
    measures = {
        "outcome": str(episode.outcome),
        "time_s": episode.time,
        "optimal_time_s": task.optimal_time,
        "barn_metric": metrics.barn_metric(success, episode.time, task.optimal_time),
        "path_length_m": episode.path_length,
        "shortest_path_length_m": shortest,
        "spl": metrics.spl(success, shortest, episode.path_length),
        "steps": episode.steps,
        "switches": episode.switches,
        "no_free_candidate": episode.no_free_candidate,
        "min_clearance_m": episode.min_clearance,
        "final_distance_m": episode.final_distance,
        "goal_tolerance_m": task.goal_tolerance,
        "start_x_m": task.start.x,
        "start_y_m": task.start.y,
        "start_yaw_rad": task.start.yaw,
        "goal_x_m": float(task.goal[0]),
        "goal_y_m": float(task.goal[1]),
        "decision_us_p50": float(np.percentile(decision_us, 50)),
        "decision_us_p99": float(np.percentile(decision_us, 99)),
    }
    return measures | {f"world_{name}": value for name, value in task.measures.items()}
