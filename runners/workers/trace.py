"""Traces of episodes: every observation and decision, from a rerun.

Records contain only the path of the robot, because observations and explanations would fill the disk. An episode is a
function of its config, world and run, so it can be run again and observed. `step_tables` gives the control steps of
episodes as recorded, or from a rerun if the run did not keep them.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.guides.lme.explanation import Explanation
from lme.navigation.episode import TRAJECTORY_COLUMNS, Episode, run_episode
from lme.navigation.navigator import Explanations, Navigator
from lme.robots import Robot
from lme.simulation.simulator import Simulator, State
from lme.types import Floats, Guidance, Observation, Pose, Twist
from lme.worlds.world import Task
from runners.config import build
from runners.config.quoting import lme_command
from runners.config.schema import DriveConfig
from runners.records import launch_record
from runners.records.episode_record import EpisodeKey, EpisodeResult, RunLabels
from runners.records.launch_record import LAUNCH, read_launch
from runners.records.parquet import TRAJECTORIES, trajectory_table
from runners.records.records import log_of, read_record
from runners.workers.episodes import EpisodePayload, episode_rng, initialise, with_contact_side
from runners.workers.executor import Map, ProcessConfig, ProcessExecutor

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

SAME_M = 1e-6  # [m] largest distance between the poses of a rerun and its record
_BLOCK = 1000  # episodes that are held in memory at once


class TracedStep(NamedTuple):
    """One decision.

    time [s]. pose: the robot's in the world. subgoal: (2,) in the world [m]. obstacles: circles (C, 3) and edges
    (E, 4) at this time, movers last. explanation: that of the guide's decision, or None if the guide gives none.
    postures: since the step before, see `lme.simulation.simulator.State`.
    """

    time: float
    pose: Pose
    observation: Observation
    subgoal: Floats
    guidance: Guidance
    command: Twist
    obstacles: tuple[Floats, Floats]
    explanation: Explanation | None
    postures: Floats | None = None


class Drive(NamedTuple):
    """Facts known about a drive without a simulator; the names are those of `Episode`."""

    outcome: str
    time: float
    trajectory: Floats


class TraceEnd(NamedTuple):
    """End of the episode, without a decision."""

    time: float
    pose: Pose
    observation: Observation
    obstacles: tuple[Floats, Floats]
    postures: Floats | None = None


class Trace(NamedTuple):
    """An episode with its config and all observations and decisions."""

    config: DriveConfig
    world: int
    run: int
    robot: Robot
    task: Task
    steps: tuple[TracedStep, ...]
    end: TraceEnd
    episode: Episode | Drive

    @property
    def frames(self) -> tuple[TracedStep | TraceEnd, ...]:
        """Return all steps, and the end."""
        return (*self.steps, self.end)

    def moving(self, frame: TracedStep | TraceEnd) -> tuple[Floats, Floats]:
        """Return circles (C, 3) and edges (E, 4) of the moving obstacles in one of the frames."""
        circles, edges = frame.obstacles
        return circles[len(self.task.world.circles) :], edges[len(self.task.world.edges) :]


def rerun(config: DriveConfig, world: int, run: int) -> Trace:
    """Run one episode of a config as `lme eval` does, and return its trace. Raises InputError."""
    config, task, _ = build.setting(config, build.map_set(config, [world]), world)
    navigator, simulator = build.navigator(config), build.simulator(config)
    tracer = _Tracer(simulator, navigator)
    rng = episode_rng(config.seed, world, run)
    episode = with_contact_side(run_episode(task, navigator, simulator, rng, tracer), config.robot, simulator)
    return Trace(config, world, run, config.robot, task, tuple(tracer.steps), tracer.end, episode)


def rerun_recorded(run_dir: Path, world: int, run: int, trajectories: pd.DataFrame) -> Trace:
    """Run a recorded episode again, and compare it with the run's `trajectories`, or without these with its record.

    Raises InputError if the run has no config or no such episode, or if the paths differ because another version of
    the program recorded the run.
    """
    launch = launch_record.read_launch(run_dir)
    if launch is None:
        raise InputError(f"{run_dir}: has no {launch_record.LAUNCH}, so its episodes cannot be run again")
    key = EpisodeKey(world, run)
    check_repeatable(launch, run_dir, key)
    steps = trajectories[(trajectories["world"] == world) & (trajectories["run"] == run)]
    record = read_record(run_dir, key) if steps.empty else {}
    trace = rerun(launch.config, world, run)
    if not is_same_drive(trace.episode, steps, record):
        raise another_path(run_dir, key)
    return trace


def check_repeatable(launch: launch_record.Launch, run_dir: Path, key: EpisodeKey) -> None:
    """Raise InputError if the config of a run does not say how its worlds changed."""
    if launch.command == "play":
        raise InputError(
            f"{run_dir}: its world changed during the drive, so only lme play can drive it again: "
            + lme_command("play", run_dir, f"{key.world}/{key.run}", *launch_record.trust_flags(run_dir))
        )


def is_same_drive(drive: Episode | Drive, steps: pd.DataFrame, record: Mapping[str, Any]) -> bool:
    """Return whether an episode took its recorded path or, without recorded steps, ends as its record says."""
    if steps.empty:
        return isinstance(drive, Episode) and ends_alike(
            record, str(drive.outcome), drive.steps, drive.path_length, drive.final_distance
        )
    recorded_path, path = steps[["x_m", "y_m"]].to_numpy(float), drive.trajectory[:, 1:3]
    return recorded_path.shape == path.shape and np.allclose(recorded_path, path, rtol=0.0, atol=SAME_M)


def ends_alike(
    record: Mapping[str, Any], outcome: str, steps: int, path_length_m: float, final_distance_m: float
) -> bool:
    """Return whether an episode ended as its record says."""
    lengths = {"path_length_m": path_length_m, "final_distance_m": final_distance_m}
    return (outcome, steps) == (record["outcome"], record["steps"]) and all(
        math.isclose(value, record[name], rel_tol=0.0, abs_tol=SAME_M) for name, value in lengths.items()
    )


def another_path(run_dir: Path, key: EpisodeKey) -> InputError:
    """Return the error that another version of the program drives an episode differently."""
    return InputError(
        f"{run_dir}: {key} takes another path when it is driven again, so another version of lme or of its "
        "libraries recorded the run: run it again with lme eval"
    )


class _Tracer:
    """Observer that keeps each step of an episode with the explanation of its decision."""

    end: TraceEnd

    def __init__(self, simulator: Simulator, navigator: Navigator) -> None:
        self._simulator = simulator
        self._explanations = Explanations(navigator)
        self.steps: list[TracedStep] = []

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        explanation = self._explanations.new()
        subgoal, obstacles = to_world(guidance.subgoal, state.pose), self._simulator.obstacles
        self.steps.append(
            TracedStep(
                state.time,
                state.pose,
                observation,
                subgoal,
                guidance,
                command,
                obstacles,
                explanation,
                state.postures,
            )
        )

    def ended(self, observation: Observation, state: State) -> None:
        obstacles = self._simulator.obstacles
        self.end = TraceEnd(state.time, state.pose, observation, obstacles, state.postures)


def step_tables(run_dir: Path, rows: Mapping[EpisodeKey, Mapping[str, Any]]) -> Iterator[pa.Table]:
    """Yield the steps of these episodes in the order of their keys, with the columns of `trajectories.parquet`.

    rows: the record of each episode. Raises InputError if episodes without steps cannot be driven again, or then
    differ from their records.
    """
    import pyarrow as pa

    keys = sorted(rows)
    with log_of(run_dir) as log, contextlib.ExitStack() as workers:
        drive: Map | None = None
        for start in range(0, len(keys), _BLOCK):
            block = keys[start : start + _BLOCK]
            table = trajectory_table(run_dir, log, block)
            stored_keys = set(map(EpisodeKey, table["world"].to_pylist(), table["run"].to_pylist()))
            missing_keys = [key for key in block if key not in stored_keys]
            # Drive only the episodes whose steps were not kept; workers start when the first is needed.
            if missing_keys:
                drive = drive or workers.enter_context(_driver(run_dir, rows))
                rerun_tables = []
                for result in drive(missing_keys):
                    record = result.record
                    end = record.outcome, record.steps, record.path_length_m, record.final_distance_m
                    if not ends_alike(rows[record.key], *end):
                        raise another_path(run_dir, record.key)
                    rerun_tables.append(_table(result))
                joined = pa.concat_tables([table, *rerun_tables], promote_options="permissive")
                table = joined.sort_by([(name, "ascending") for name in ("world", "run", "step")])
            yield table


@contextlib.contextmanager
def _driver(run_dir: Path, rows: Mapping[EpisodeKey, Mapping[str, Any]]) -> Iterator[Map]:
    """Give a `map` that drives these episodes of a run, in processes. rows: their records, with the same labels."""
    launch = read_launch(run_dir)
    if launch is None:
        raise InputError(
            f"{run_dir}: has no {TRAJECTORIES} with all steps, and no {LAUNCH} to drive its episodes again"
        )
    key, row = next(iter(rows.items()))
    check_repeatable(launch, run_dir, key)
    labels = RunLabels(**{field.name: str(row.get(field.name, "")) for field in fields(RunLabels)})
    # Take the worlds from the records: lme figure also drives worlds that its config does not choose.
    worlds = sorted({key.world for key in rows})
    config = replace(launch.config, map={**launch.config.map, "worlds": worlds})
    payload = EpisodePayload(config, labels, None)
    with ProcessExecutor(ProcessConfig(workers=None)).open(initialise, payload) as run_all:
        yield run_all


def _table(result: EpisodeResult) -> pa.Table:
    import pyarrow as pa

    count = len(result.trajectory)
    columns: Sequence[np.ndarray[Any, Any]] = list(result.trajectory.T)
    return pa.table(
        {
            "world": np.full(count, result.record.world),
            "run": np.full(count, result.record.run),
            "step": np.arange(count),
            **dict(zip(TRAJECTORY_COLUMNS, columns, strict=True)),
        }
    )
