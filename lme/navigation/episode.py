"""Run one episode and record its outcome."""

from __future__ import annotations

import math
from dataclasses import dataclass
from time import perf_counter_ns
from typing import Protocol

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_world, wrap_angle
from lme.geometry.motion import time_beyond, travelled
from lme.inputs.returned import ReturnedError, checked_observation
from lme.navigation.navigator import Navigator
from lme.simulation.simulator import Changeable, Simulator, State
from lme.types import Floats, Guidance, Observation, Outcome, Twist
from lme.worlds.world import Task

TRAJECTORY_COLUMNS = (
    "time_s",
    "x_m",
    "y_m",
    "yaw_rad",
    "v_mps",
    "omega_radps",
    "subgoal_x_m",
    "subgoal_y_m",
    "switched",
    "clearance_m",
)


@dataclass(frozen=True, slots=True)
class Episode:
    """Result of one episode.

    time: traversal time [s]; the clock starts when the robot has left the start by the task's clock distance.
    path_length, min_clearance, final_distance: [m]. switches: subgoal switches. no_free_candidate: steps at which
    the guide was blocked. contact_part: see `lme.simulation.simulator.State`; of other robots, the side that
    collided, if it is known (`lme.simulation.contact_side`). trajectory: (T, 10), columns TRAJECTORY_COLUMNS in the
    world frame, one row per decision and one for the end. decision_us: (steps,) computing time of each decision [µs].
    """

    outcome: Outcome
    time: float
    path_length: float
    steps: int
    switches: int
    no_free_candidate: int
    min_clearance: float
    final_distance: float
    contact_part: str
    trajectory: Floats
    decision_us: Floats

    @property
    def speeds(self) -> Floats:
        """Executed forward speed, a column of the trajectory: (T,) [m/s]."""
        return self.trajectory[:, TRAJECTORY_COLUMNS.index("v_mps")]

    @property
    def turn_rates(self) -> Floats:
        """Executed turn rate, a column of the trajectory: (T,) [rad/s]."""
        return self.trajectory[:, TRAJECTORY_COLUMNS.index("omega_radps")]


class Observer(Protocol):
    """Receives every step of a running episode, which it must not influence."""

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        """Called after each decision and before its execution; `state`: the true state at the decision."""

    def ended(self, observation: Observation, state: State) -> None:
        """Called at the end of the episode, after the last step."""


def run_episode(
    task: Task,
    navigator: Navigator,
    simulator: Simulator,
    rng: np.random.Generator,
    observer: Observer | None = None,
) -> Episode:
    """Drive from the start until arrival, contact or time-out. `rng` is the only source of randomness."""
    running = RunningEpisode(task, navigator, simulator, rng)
    while running.outcome() is None:
        command = running.decide()
        if observer is not None:
            assert navigator.observation is not None
            assert navigator.guidance is not None
            observer.decided(navigator.observation, navigator.guidance, command, simulator.state)
        running.move(command)
    if observer is not None:
        observer.ended(running.observation, simulator.state)
    return running.episode()


class RunningEpisode:
    """Episode that its caller advances: `decide`, then `move`, until there is an `outcome`.

    observation: the newest. navigator, simulator: in use by this episode; nothing else may use them meanwhile.
    decision_us: computing time of the last decision [µs].
    """

    def __init__(
        self, task: Task, navigator: Navigator, simulator: Simulator, rng: np.random.Generator
    ) -> None:
        navigator_rng, simulator_rng = rng.spawn(2)
        self.navigator, self.simulator = navigator, simulator
        navigator.reset(navigator_rng)
        navigator.read_map(task.world, task.start)
        observation = simulator.reset(task, simulator_rng)
        self.decision_us = 0.0
        self._task = task
        self._progress = Progress(task, simulator.state)
        self._switches = self._no_free_candidate = 0
        self._rows: list[tuple[float, ...]] = []
        self._decisions_us: list[float] = []
        self._ships = type(simulator).__module__.startswith("lme.simulation.")
        self.observation = self._checked(observation)

    def outcome(self) -> Outcome | None:
        """The outcome; None while the episode continues."""
        return self._progress.outcome(self.simulator.state)

    def decide(self) -> Twist:
        """Return the navigator's command for the newest observation."""
        start_ns = perf_counter_ns()
        command = self.navigator.act(self.observation)
        self.decision_us = (perf_counter_ns() - start_ns) / 1000.0
        # Record the decision before its execution.
        guidance = self.navigator.guidance
        assert guidance is not None
        self._previous_state = self.simulator.state
        self._rows.append(self._row(to_world(guidance.subgoal, self._previous_state.pose), guidance.switched))
        self._switches += guidance.switched
        self._no_free_candidate += guidance.blocked
        self._decisions_us.append(self.decision_us)
        return command

    def change(self, task: Task) -> None:
        """Continue among the obstacles of another task and to its goal; see `lme.simulation.simulator.Changeable`.

        Call it before `decide`. A guide that was given the map keeps that map. Raises InputError for a simulator that
        cannot change its task.
        """
        if not isinstance(self.simulator, Changeable):
            name = type(self.simulator).__name__
            raise InputError(
                f"{name}: the world cannot change while the robot drives, since it has no `change`"
            )
        self.observation = self.simulator.change(task)
        self._task = task
        self._progress.change(task)

    def move(self, command: Twist) -> None:
        """Drive for one control period."""
        observation = self.simulator.step(command)
        self._progress.moved(self._previous_state, self.simulator.state)
        self.observation = self._checked(observation)

    def _checked(self, observation: Observation) -> Observation:
        """Return the simulator's result, checked if it is a user's own. Raises InputError, which names the step."""
        if self._ships:
            return observation
        try:
            return checked_observation(observation, self.simulator.state, self.simulator)
        except ReturnedError as error:
            raise InputError(f"step {len(self._rows)}: {error}") from error

    def episode(self) -> Episode:
        """Return the result. Call it at the end."""
        state, outcome = self.simulator.state, self.outcome()
        assert outcome is not None
        return Episode(
            outcome=outcome,
            time=self._progress.time(state),
            path_length=self._progress.path_length,
            steps=len(self._decisions_us),
            switches=self._switches,
            no_free_candidate=self._no_free_candidate,
            min_clearance=self._progress.min_clearance,
            final_distance=math.dist(state.pose[:2], self._task.goal),
            contact_part=state.contact_part,
            trajectory=np.array([*self._rows, self._row(np.full(2, np.nan), False)]),
            decision_us=np.array(self._decisions_us),
        )

    def _row(self, subgoal: Floats, switched: bool) -> tuple[float, ...]:
        state = self.simulator.state
        x, y, yaw = state.pose
        subgoal_x, subgoal_y = subgoal.tolist()
        return (
            state.time, x, y, wrap_angle(yaw), *state.twist, subgoal_x, subgoal_y, float(switched), state.clearance,
        )  # fmt: skip


class Progress:
    """Path length, least clearance, time and outcome of a running episode.

    path_length, min_clearance: [m] so far.
    """

    def __init__(self, task: Task, state: State) -> None:
        """state: the state after the simulator's reset."""
        self._task = task
        self._start = np.array(task.start[:2])
        self._clock_start = math.nan if task.clock_distance > 0.0 else 0.0
        self.path_length = 0.0
        self.min_clearance = state.clearance

    def change(self, task: Task) -> None:
        """Apply the rules of another task from now on."""
        self._task = task

    def moved(self, previous: State, state: State) -> None:
        """Record the motion of a control period."""
        self.path_length += travelled(previous.pose.x, previous.pose.y, state.travel)
        self.min_clearance = min(self.min_clearance, state.clearance)
        if math.isnan(self._clock_start):
            distance = self._task.clock_distance
            self._clock_start = time_beyond(state.travel, self._start, distance, previous.time, state.time)

    def time(self, state: State) -> float:
        """Time on the task's clock, at most the limit [s]."""
        return min(self._elapsed(state), self._task.time_limit)

    def outcome(self, state: State) -> Outcome | None:
        """The outcome; None while the episode continues."""
        if state.contact:
            return Outcome.COLLISION
        if self._elapsed(state) >= self._task.time_limit - 1e-9:  # arrival is too late
            return Outcome.TIMEOUT
        return Outcome.SUCCESS if state.arrived else None

    def _elapsed(self, state: State) -> float:
        return state.time if math.isnan(self._clock_start) else state.time - self._clock_start
