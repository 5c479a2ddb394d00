"""Traces of episodes: all that the robot saw and decided, from a rerun.

Records say where the robot went. What it saw and why it went there would fill disks. An episode is a function of
its config, its world and its run, so it can be driven again and watched.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lme.episode import Episode, run_episode
from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.navigator import Navigator
from lme.policy.explanation import Decision, Explanation
from lme.robots import Robot
from lme.sim.simulator import Simulator, State
from lme.types import Floats, Guidance, Observation, Pose, Twist
from lme.worlds.world import Task
from runners.config import build
from runners.config.schema import DriveConfig
from runners.records import launch_record
from runners.workers.episodes import episode_rng

if TYPE_CHECKING:
    import pandas as pd

SAME_M = 1e-6  # [m] a rerun keeps to its record so closely


class TracedStep(NamedTuple):
    """One decision.

    pose: of the robot in the world. subgoal: (2,) in the world [m]. obstacles: circles (C, 3) and edges (E, 4) as
    they stand, movers last. explanation: why the guide decided so; None where it does not say.
    """

    time: float
    pose: Pose
    observation: Observation
    subgoal: Floats
    guidance: Guidance
    command: Twist
    obstacles: tuple[Floats, Floats]
    explanation: Explanation | None


class TraceEnd(NamedTuple):
    """The end of the episode, on which no decision follows."""

    time: float
    pose: Pose
    observation: Observation
    obstacles: tuple[Floats, Floats]


class Trace(NamedTuple):
    """An episode with all that was seen and decided. config: what it was driven with."""

    config: DriveConfig
    world: int
    run: int
    robot: Robot
    task: Task
    steps: tuple[TracedStep, ...]
    end: TraceEnd
    episode: Episode

    @property
    def frames(self) -> tuple[TracedStep | TraceEnd, ...]:
        """Every step, and the end."""
        return (*self.steps, self.end)

    def moving(self, frame: TracedStep | TraceEnd) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) of what moves, where they stand in one of the frames."""
        circles, edges = frame.obstacles
        return circles[len(self.task.world.circles) :], edges[len(self.task.world.edges) :]


def rerun(config: DriveConfig, world: int, run: int) -> Trace:
    """Drive one episode of a config as `lme eval` does, and keep all of it. Raises InputError."""
    task, simulator = build.map_set(config, [world]).task(world), build.simulator(config)
    navigator = build.navigator(config)
    tracer = _Tracer(simulator, navigator)
    episode = run_episode(task, navigator, simulator, episode_rng(config.seed, world, run), tracer)
    return Trace(config, world, run, config.robot, task, tuple(tracer.steps), tracer.end, episode)


def rerun_recorded(run_dir: Path, world: int, run: int, trajectories: pd.DataFrame) -> Trace:
    """Drive an episode of a run again, and compare it with its record among the run's `trajectories`.

    Raises InputError where the run has no such episode or no config, or where another version of the program
    drove another way.
    """
    launch = launch_record.read_launch(run_dir)
    if launch is None:
        raise InputError(
            f"{run_dir}: holds no {launch_record.LAUNCH}, so its episodes cannot be driven again"
        )
    steps = trajectories[(trajectories["world"] == world) & (trajectories["run"] == run)]
    if steps.empty:
        raise InputError(
            f"{run_dir}: holds no episode of world {world}, run {run}; lme table {run_dir} lists"
        )
    trace = rerun(launch.config, world, run)
    recorded = steps[["x_m", "y_m"]].to_numpy()
    driven = trace.episode.trajectory[:, 1:3]
    if recorded.shape != driven.shape or not np.allclose(recorded, driven, rtol=0.0, atol=SAME_M):
        raise InputError(
            f"{run_dir}: world {world}, run {run} goes another way when it is driven again, so the run was made by "
            "another version of the program or of its libraries: run it anew with lme eval"
        )
    return trace


class _Tracer:
    """Keeps each step of an episode, and why the guide decided so."""

    end: TraceEnd

    def __init__(self, simulator: Simulator, navigator: Navigator) -> None:
        self._simulator = simulator
        self._navigator = navigator
        self._explained: Decision | None = None
        self.steps: list[TracedStep] = []

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        why = self._new_explanation()
        subgoal, obstacles = to_world(guidance.subgoal, state.pose), self._simulator.obstacles
        self.steps.append(
            TracedStep(state.time, state.pose, observation, subgoal, guidance, command, obstacles, why)
        )

    def ended(self, observation: Observation, state: State) -> None:
        self.end = TraceEnd(state.time, state.pose, observation, self._simulator.obstacles)

    def _new_explanation(self) -> Explanation | None:
        """None where the guide's last decision is an earlier step's: one made from LME may not ask it every time."""
        why = self._navigator.explanation()
        if why is None or why.decision is self._explained:
            return None
        self._explained = why.decision
        return why
