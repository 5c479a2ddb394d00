"""An episode told again, decision by decision.

Records say where the robot went; what it saw and why it went there would fill disks. An episode is a function of
its config, its world and its number, so it is driven once more, and looked at while it is driven.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.episode import Episode, run_episode
from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.guides.lme import Lme
from lme.policy.escaper import Decision, Explanation, LocalMinimumEscaper
from lme.robots import Robot
from lme.sim.simulator import Simulator, State
from lme.types import Floats, Guidance, Guide, Observation, Pose, Twist
from lme.worlds.world import Task
from runners.config import build
from runners.records import launch_record
from runners.workers.episodes import episode_rng

if TYPE_CHECKING:
    import pandas as pd

SAME_M = 1e-6  # [m] an episode told again keeps to its record so closely


class Moment(NamedTuple):
    """One decision.

    pose: of the robot in the world. subgoal: (2,) in the world [m]. obstacles: circles (C, 3) and edges (E, 4) as
    they stand, movers last. explanation: how LME came to it, before it was carried out; None of other guides.
    """

    time: float
    pose: Pose
    observation: Observation
    subgoal: Floats
    guidance: Guidance
    command: Twist
    obstacles: tuple[Floats, Floats]
    explanation: Explanation | None


class End(NamedTuple):
    """The end, on which no decision follows."""

    time: float
    pose: Pose
    observation: Observation
    obstacles: tuple[Floats, Floats]


class Tale(NamedTuple):
    """An episode with all that was seen and decided. config: the plain config that it was driven with."""

    config: Mapping[str, Any]
    world: int
    run: int
    robot: Robot
    task: Task
    moments: tuple[Moment, ...]
    end: End
    episode: Episode

    @property
    def frames(self) -> tuple[Moment | End, ...]:
        """Every decision, and the end."""
        return (*self.moments, self.end)

    def moving(self, frame: Moment | End) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) of what moves, where they stand in one of the frames."""
        circles, edges = frame.obstacles
        return circles[len(self.task.world.circles) :], edges[len(self.task.world.edges) :]


def retell(config: Mapping[str, Any], world: int, run: int) -> Tale:
    """Drive one episode of a plain config as `lme eval` does, and keep all of it. Raises InputError.

    LME is asked for its reasons at every step, which about doubles the time of its decisions.
    """
    robot = build.robot(config)
    task, simulator = build.map_set(config).task(world), build.simulator(config, robot)
    navigator = build.navigator(config, robot)
    witness = _Witness(simulator, navigator.guide)
    episode = run_episode(task, navigator, simulator, episode_rng(config["seed"], world, run), witness)
    return Tale(config, world, run, robot, task, tuple(witness.moments), witness.end, episode)


def retell_recorded(run_dir: Path, world: int, run: int, trajectories: pd.DataFrame) -> Tale:
    """Tell an episode of a run again, and hold it against its record among the run's `trajectories`.

    Raises InputError where the run has no such episode, no config, or where another version of the program
    drove it otherwise.
    """
    launch = launch_record.read_launch(run_dir)
    if launch is None:
        raise InputError(f"{run_dir}: holds no {launch_record.LAUNCH}, so its episodes cannot be told again")
    steps = trajectories[(trajectories["world"] == world) & (trajectories["run"] == run)]
    if steps.empty:
        raise InputError(
            f"{run_dir}: holds no episode of world {world}, run {run}; lme table {run_dir} lists"
        )
    tale = retell(launch.configs[0], world, run)
    recorded = steps[["x_m", "y_m"]].to_numpy()
    told = tale.episode.trajectory[:, 1:3]
    if recorded.shape != told.shape or not np.allclose(recorded, told, rtol=0.0, atol=SAME_M):
        raise InputError(
            f"{run_dir}: world {world}, run {run} goes another way when it is driven again, so the run was made by "
            "another version of the program or of its libraries: run it anew with lme eval"
        )
    return tale


class _Witness:
    """Looks on while an episode is driven, and asks LME for its reasons before it decides."""

    end: End

    def __init__(self, simulator: Simulator, guide: Guide) -> None:
        self._simulator = simulator
        self._why: Explanation | None = None
        self.moments: list[Moment] = []
        if isinstance(guide, Lme):
            self._ask(guide.escaper)

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        why, self._why = self._why, None
        subgoal, obstacles = to_world(guidance.subgoal, state.pose), self._simulator.obstacles
        self.moments.append(
            Moment(state.time, state.pose, observation, subgoal, guidance, command, obstacles, why)
        )

    def ended(self, observation: Observation, state: State) -> None:
        self.end = End(state.time, state.pose, observation, self._simulator.obstacles)

    def _ask(self, escaper: LocalMinimumEscaper) -> None:
        """Only `decide` is stood in for: a guide made from Lme keeps all else that it has, and what it asks is seen."""
        decide = escaper.decide

        def explained(observation: Observation) -> Decision:
            self._why = escaper.explain(observation)
            return decide(observation)

        escaper.decide = explained  # type: ignore[method-assign]
