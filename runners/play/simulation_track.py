"""One system in the world: the frames of its drive so far, and the running episode that produces the next one."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lme.geometry.frames import to_world, wrap_angle
from lme.guides.lme.explanation import Explanation, reason
from lme.navigation.episode import Episode, RunningEpisode
from lme.navigation.navigator import Explanations, Navigator
from lme.simulation.simulator import Simulator, State
from lme.types import Floats, Outcome, Twist
from lme.worlds.world import Task
from runners.config import build
from runners.config.schema import DriveConfig
from runners.workers.trace import TracedStep, TraceEnd

EVERY = 10  # steps from one snapshot to the next
MOST_SNAPSHOTS = 60  # older ones are thinned out, so that going far back takes longer
_NO_COPY = (TypeError, ValueError, NotImplementedError)  # raised by copying a class that does not allow it

Tasks = Mapping[int, Task]  # the task from each step on at which it changes; 0 is among them


class Frame(NamedTuple):
    """One moment of a drive, and the decision made there.

    moment: a step, or the end, which has no decision. state: of the simulator. movers: those that move, as circles
    (C, 3) and edges (E, 4). sentence: the reason, if the guide gives one. decision_us: duration of the decision [µs].
    outcome: only at the end.
    """

    moment: TracedStep | TraceEnd
    state: State
    movers: tuple[Floats, Floats]
    sentence: str = ""
    decision_us: float = 0.0
    outcome: Outcome | None = None

    @property
    def row(self) -> tuple[float, ...]:
        """Time, pose, twist and clearance."""
        x, y, yaw = self.state.pose
        return self.state.time, x, y, wrap_angle(yaw), *self.state.twist, self.state.clearance


def trajectory_of(frames: Sequence[Frame]) -> Floats:
    """Return the frames as rows (F, 10) with TRAJECTORY_COLUMNS; those of subgoals are NaN."""
    rows = np.array([frame.row for frame in frames])
    trajectory = np.full((len(frames), 10), np.nan)
    trajectory[:, :6], trajectory[:, 9] = rows[:, :6], rows[:, 6]
    return trajectory


class _RunningDrive(NamedTuple):
    """The whole state that decides how a drive continues. It is always copied as one."""

    episode: RunningEpisode
    explanations: Explanations


class SimulationTrack:
    """A drive of one system that can be rewound. `frames` are those so far, the first at step 0.

    A drive is a function of its config, its random numbers and the tasks by step. Rewinding it and driving on
    therefore gives the same frames, unless the tasks have changed.
    """

    def __init__(self, config: DriveConfig, label: str, rng: Callable[[], np.random.Generator]) -> None:
        """Build the system. label: its name in tables. rng: makes the episode's generator. Raises InputError."""
        self.config, self.label = config, label
        self.frames: list[Frame] = []
        self._rng = rng
        self._navigator, self._simulator = build.navigator(config), build.simulator(config)
        self._snapshots: dict[int, _RunningDrive] = {}
        self._command: Twist | None = None  # of the last frame, not executed yet

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the drive; None before its end."""
        return self.frames[-1].outcome if self.frames else None

    def episode(self) -> Episode | None:
        """Return the finished episode; None before the end."""
        return None if self.outcome is None else self._running.episode.episode()

    def extend(self, tasks: Tasks) -> bool:
        """Add the next frame; return False if the drive has ended."""
        if self.outcome is not None:
            return False
        step = len(self.frames)
        if not self.frames:
            self._begin(tasks[0])
        elif self._command is not None:
            command, self._command = self._command, None  # if the next decision fails, it is not driven again
            self._running.episode.move(command)
        self._arrive(step, tasks)
        self.frames.append(self._frame())
        return True

    def rewound(self, step: int, tasks: Tasks) -> SimulationTrack:
        """Return a lane without the frames from `step` on; whatever it drives leaves this lane unchanged."""
        lane = copy.copy(self)
        lane.frames, lane._snapshots = list(self.frames), dict(self._snapshots)
        lane.rewind(step, tasks)
        return lane

    def rewind(self, step: int, tasks: Tasks) -> None:
        """Forget the frames from `step` on, so that it is the next step.

        The drive is repeated by `tasks` up to there.
        """
        if step >= len(self.frames):
            return
        # Go back to the latest snapshot up to the step, or to the beginning.
        former = self.frames[:step]
        self._snapshots = {
            start: snapshot for start, snapshot in self._snapshots.items() if 0 < start <= step
        }
        start = max(self._snapshots, default=0)
        self.frames, self._command = former[:start], None
        if start:
            self._world = tasks[max(change for change in tasks if change < start or not change)].world
            self._running = self._copy(self._snapshots[start], tasks)
        # Drive on to the step, but show the frames that were recorded first.
        while len(self.frames) < step:
            self.extend(tasks)
        self.frames = former  # equal to the new ones, except for decision times
        # Execute the command that leads to the step, so that a snapshot can be taken there.
        if self._command is not None:
            self._running.episode.move(self._command)
            self._command = None
            self._keep(step, tasks)

    def before(self, step: int, tasks: Tasks) -> RunningEpisode | None:
        """Return a copy of the episode just before its decision at a step; None if there is none.

        There is none at the end of a drive, or if the episode cannot be copied.
        """
        snapshots = [snapshot_step for snapshot_step in self._snapshots if snapshot_step <= step]
        if not snapshots or isinstance(self.frames[step].moment, TraceEnd):
            return None
        # Drive a copy of the latest snapshot on to the step, through every change of the task.
        episode = self._copy(self._snapshots[max(snapshots)], tasks).episode
        for replayed_step in range(max(snapshots), step + 1):
            if replayed_step and replayed_step in tasks:
                episode.change(tasks[replayed_step])
            if replayed_step < step:
                episode.move(episode.decide())
        return episode

    def _begin(self, task: Task) -> None:
        navigator, simulator = self._fresh()
        episode = RunningEpisode(task, navigator, simulator, self._rng())
        self._running, self._world = _RunningDrive(episode, Explanations(navigator)), task.world

    def _fresh(self) -> tuple[Navigator, Simulator]:
        """Return a navigator and a simulator that no other drive uses."""
        try:
            return copy.deepcopy((self._navigator, self._simulator))
        except _NO_COPY:
            return build.navigator(self.config), build.simulator(self.config)

    def _arrive(self, step: int, tasks: Tasks) -> None:
        """Keep a snapshot every few steps, and switch to the task that begins at this step."""
        if step % EVERY == 0 and step not in self._snapshots:
            self._keep(step, tasks)
        if step and step in tasks:
            self._running.episode.change(tasks[step])
            self._world = tasks[step].world

    def _frame(self) -> Frame:
        episode, explanations = self._running
        simulator, navigator = episode.simulator, episode.navigator
        outcome, obstacles = episode.outcome(), simulator.obstacles
        circles, edges = obstacles
        movers = circles[len(self._world.circles) :], edges[len(self._world.edges) :]
        # The last frame has no decision.
        if outcome is not None:
            self._command, state = None, simulator.state
            end = TraceEnd(state.time, state.pose, episode.observation, obstacles)
            return Frame(end, state, movers, outcome=outcome)
        # Decide, and keep what the decision was made of; the command is executed with the next frame.
        self._command = command = episode.decide()
        guidance, observation, state = navigator.guidance, navigator.observation, simulator.state
        assert guidance is not None
        assert observation is not None
        explanation = explanations.new()
        subgoal = to_world(guidance.subgoal, state.pose)
        step = TracedStep(
            state.time, state.pose, observation, subgoal, guidance, command, obstacles, explanation
        )
        return Frame(step, state, movers, self._sentence(explanation), episode.decision_us)

    def _sentence(self, explanation: Explanation | None) -> str:
        if explanation is None:
            return ""
        previous = self.frames[-1].moment if self.frames else None
        return reason(explanation, previous.explanation if isinstance(previous, TracedStep) else None)

    def _keep(self, step: int, tasks: Tasks) -> None:
        """Keep a copy of the drive before what happens at a step. A drive that cannot be copied has no snapshots."""
        try:
            self._snapshots[step] = self._copy(self._running, tasks)
        except _NO_COPY:
            self._snapshots = {}
        if len(self._snapshots) > MOST_SNAPSHOTS:
            for dropped_step in sorted(self._snapshots)[1 : -MOST_SNAPSHOTS // 3 : 2]:  # the first one stays
                del self._snapshots[dropped_step]

    def _copy(self, running: _RunningDrive, tasks: Tasks) -> _RunningDrive:
        """Return a copy that shares what never changes and is recognised by identity: tasks, worlds, movers."""
        pieces = (piece for task in tasks.values() for piece in (task, task.world, *task.world.movers))
        return copy.deepcopy(running, {id(piece): piece for piece in pieces})
