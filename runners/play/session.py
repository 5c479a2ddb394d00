"""A session: the drawing, the systems that drive in it, and every change that the user has made."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from lme.errors import InputError
from lme.types import Outcome, Pose
from lme.worlds.check import check_task
from lme.worlds.world import Task
from runners.config.schema import DriveConfig
from runners.play.drawing import Item, Sketch
from runners.play.simulation_track import SimulationTrack
from runners.records.episode_record import RunLabels
from runners.workers.episodes import episode_rng

MOST_STEPS = 20_000  # most steps of a drive
UNDONE = 100  # most changes that can be undone


@dataclass(frozen=True, slots=True)
class Source:
    """Words of a command line, the config that they change, and the folder of the user's own options."""

    words: tuple[str, ...]
    config_name: str = "play"
    config_dir: Path | None = None


@dataclass(frozen=True, slots=True)
class Entrant:
    """The system that a lane drives.

    label: its name on the page. words: of the `lme eval` command line that makes it, with every choice. labels: those
    of its records.
    """

    config: DriveConfig
    label: str
    words: tuple[str, ...]
    labels: RunLabels


@dataclass(frozen=True, slots=True)
class Setup:
    """The beginning of a session: the systems, a task, and the run, which fixes the random numbers with the world.

    numbers: of the worlds of the map set. source: what the systems were made from; None where it is unknown, as for a
    recording.
    """

    systems: tuple[Entrant, ...]
    task: Task
    run: int
    source: Source | None
    numbers: tuple[int, ...] = ()

    @property
    def seed(self) -> int:
        """Seed of the random numbers, which also depend on the world's number and on the run."""
        return self.systems[0].config.seed


@dataclass(frozen=True, slots=True)
class Script:
    """Everything that determines a session's drives: if it changes, they differ.

    drawings: by the step from which they apply, including step 0. begin: where the drive begins, if not at the
    drawing's start.
    """

    setup: Setup
    drawings: Mapping[int, Sketch]
    begin: Pose | None = None

    @property
    def changed(self) -> bool:
        """Return whether the world changes while the systems drive."""
        return len(self.drawings) > 1

    def at(self, step: int) -> Sketch:
        """Return the drawing at a step."""
        return self.drawings[max(at for at in self.drawings if at <= step)]


@dataclass(slots=True)
class _HistoryEntry:
    """The script before a change, and the step that was shown. gesture: of the change; a drag is a single gesture."""

    script: Script
    step: int
    gesture: str


class Session:
    """The drives of a script's systems, step by step, and the changes of the script.

    lanes: one per system. tasks: by step. `revision` counts the changes, `kept` is the number of frames that the last
    change left as they were, and `shown` is the step at which it was made.
    """

    def __init__(self, setup: Setup) -> None:
        """Begin the drives. Raises InputError for a task or a system that cannot be driven."""
        self.revision = self.kept = self.shown = 0
        self._past: list[_HistoryEntry] = []
        self._future: list[_HistoryEntry] = []
        self.script = Script(setup, {0: Sketch.of(setup.task)})
        self.lanes: list[SimulationTrack] = []
        self.tasks: dict[int, Task] = {}
        self._stage(self.script)

    def advance(self, until: int, budget_s: float) -> None:
        """Drive until every lane has frames up to step `until` or has ended, but no longer than `budget_s`."""
        _drive(self.lanes, self.tasks, until, budget_s)

    @property
    def last(self) -> int:
        """The last step that any lane has reached."""
        return max(len(lane.frames) for lane in self.lanes) - 1

    def play(self, script: Script) -> None:
        """Replace the script and begin it. If it raises InputError, nothing changes."""
        self._play(script, 0, "")

    def change(self, step: int, drawing: Sketch, gesture: str = "") -> None:
        """Make a drawing apply from a step on and forget what came after. If it raises InputError, nothing changes.

        gesture: changes of the same gesture are undone together. A start that moves begins the drive again.
        """
        step = min(step, self.last)
        current = self.script.at(step)
        if drawing.start != current.start:
            drawings, step, begin = {0: drawing}, 0, None
        else:
            earlier = {
                change_step: former_drawing
                for change_step, former_drawing in self.script.drawings.items()
                if change_step < step
            }
            drawings, begin = {**earlier, step: drawing}, self.script.begin
        self._play(replace(self.script, drawings=drawings, begin=begin), step, gesture)

    def put(self, step: int, name: str, item: Item, gesture: str = "") -> None:
        """Put an item into the world at a step. Raises InputError."""
        self.change(step, self.script.at(step).put(name, item), gesture)

    def erase(self, step: int, name: str, gesture: str = "") -> None:
        """Take an item out of the world at a step. Raises InputError."""
        self.change(step, self.script.at(step).erase(name), gesture)

    def move_goal(self, step: int, goal: tuple[float, float], gesture: str = "") -> None:
        """Move the goal [m] at a step."""
        self.change(step, replace(self.script.at(step), goal=goal), gesture)

    def move_start(self, step: int, start: Pose, gesture: str = "") -> None:
        """Move the robot and begin the drive again there. Raises InputError where the robot does not fit."""
        self.change(step, replace(self.script.at(step), start=start), gesture)

    def clear(self, step: int) -> None:
        """Remove all drawn items and restore all erased parts, at a step."""
        self.change(step, self.script.at(step).clear())

    def reset(self) -> None:
        """Begin again at the start, with the same random numbers, in the world as it is now."""
        script = replace(self.script, drawings={0: self.script.at(self.last)}, begin=None)
        self._play(script, 0, "", shown_step=self.last)

    def choose(self, setup: Setup, step: int) -> None:
        """Drive with other systems. If it raises InputError, nothing changes.

        In the same world, a single robot continues from its pose at the step, at rest, while the clock and the movers
        begin again; several robots begin again at the start, to be compared.
        """
        # Another task: begin with its untouched drawing.
        if setup.task is not self.script.setup.task:
            self._play(Script(setup, {0: Sketch.of(setup.task)}), 0, "", shown_step=step)
            return
        # The same task: keep the drawing, and let a single robot that has not collided go on from where it is.
        begin = None
        if len(setup.systems) == len(self.lanes) == 1 and self.lanes[0].outcome is not Outcome.COLLISION:
            begin = self.lanes[0].frames[min(step, self.last)].state.pose
        self._play(Script(setup, {0: self.script.at(step)}, begin), 0, "", shown_step=step)

    def state(self) -> dict[str, Any]:
        """Return everything that a change may modify, for `restore`."""
        return {**vars(self), "_past": [*self._past], "_future": [*self._future]}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore the state from before a change."""
        vars(self).update(state)

    @property
    def undoable(self) -> bool:
        """Return whether a change can be undone."""
        return bool(self._past)

    @property
    def redoable(self) -> bool:
        """Return whether an undone change can be made again."""
        return bool(self._future)

    def undo(self) -> None:
        """Undo the last change, and return to the step where it was made. Raises InputError if there is none."""
        self._travel(self._past, self._future)

    def redo(self) -> None:
        """Make the last undone change again. Raises InputError if there is none."""
        self._travel(self._future, self._past)

    def _travel(self, source: list[_HistoryEntry], opposite: list[_HistoryEntry]) -> None:
        if not source:
            raise InputError("there is no change to take back or to make again")
        # Stage the other script first: if that fails, the history stays as it is.
        past, script = source[-1], self.script
        self._stage(past.script)
        source.pop()
        opposite.append(_HistoryEntry(script, past.step, past.gesture))
        self.advance(past.step, budget_s=60.0)
        self.shown = min(past.step, self.last)

    def _play(self, script: Script, step: int, gesture: str, shown_step: int | None = None) -> None:
        """Replace the script by one with the same drawings before a step. shown_step: where it was chosen."""
        past = _HistoryEntry(self.script, step if shown_step is None else min(shown_step, self.last), gesture)
        # The same systems up to the step: rewind the lanes and drive on from there. Else begin again.
        if script.setup is self.script.setup and script.begin == self.script.begin and step:
            tasks = {change_step: task for change_step, task in self.tasks.items() if change_step < step}
            tasks[step] = self._task(script, step)
            self._enter(script, [lane.rewound(step, self.tasks) for lane in self.lanes], tasks, step)
        else:
            self._stage(script)
        # Remember the former script, once for each gesture.
        if not (gesture and self._past and self._past[-1].gesture == gesture):
            self._past = [*self._past[-UNDONE:], past]
        self._future = []

    def _stage(self, script: Script) -> None:
        """Begin the drives of a script. If it raises InputError, nothing changes."""
        tasks = {change_step: self._task(script, change_step) for change_step in script.drawings}
        for system in script.setup.systems:
            check_task(tasks[0], system.config.robot)
        self._enter(script, self._lanes_of(script), tasks, 0)

    def _enter(self, script: Script, lanes: list[SimulationTrack], tasks: dict[int, Task], step: int) -> None:
        """Drive the frame at a step, and only then adopt the script: if that fails, nothing has changed."""
        _drive(lanes, tasks, step, budget_s=10.0)
        self.script, self.lanes, self.tasks, self.kept = script, lanes, tasks, step
        self.revision += 1
        self.shown = step

    def _lanes_of(self, script: Script) -> list[SimulationTrack]:
        """Return the lanes of a script; copies of the present ones if their systems are the same."""
        setup = script.setup
        if self.lanes and setup is self.script.setup:
            return [lane.rewound(0, self.tasks) for lane in self.lanes]
        rng = partial(episode_rng, setup.seed, setup.task.number, setup.run)
        return [SimulationTrack(system.config, system.label, rng) for system in setup.systems]

    def _task(self, script: Script, step: int) -> Task:
        task = script.drawings[step].task()
        return task if script.begin is None else replace(task, start=script.begin)


def _drive(lanes: Sequence[SimulationTrack], tasks: Mapping[int, Task], until: int, budget_s: float) -> None:
    """Drive the lanes, the shortest first, until each has a frame at step `until`, has ended, or the time is up."""
    start_time = time.monotonic()
    until = min(until, MOST_STEPS)
    # Always extend the shortest lane, so that all lanes stay at nearly the same step.
    while any(len(lane.frames) <= until and lane.outcome is None for lane in lanes):
        shortest = min((lane for lane in lanes if lane.outcome is None), key=lambda lane: len(lane.frames))
        shortest.extend(tasks)
        if time.monotonic() - start_time > budget_s:
            return
