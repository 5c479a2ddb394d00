"""Recordings of what the live driver saw and decided: an MCAP file per goal, for `lme replay` and `lme explain`."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Self

from lme.guides.lme.explanation import Explanation, reason
from lme.live.driver import LiveDriver
from lme.live.step import LiveState, LiveStep
from runners.config.schema import DriveConfig
from runners.records.launch_record import identity
from runners.workers.mcap_episodes import LATCHED, STATE, TAKEN, TOPICS, WANTED, WHY, DecisionWriter, McapFile

LIVE_TOPICS = {
    **TOPICS,
    WANTED: "geometry_msgs/msg/Twist",
    WHY: "std_msgs/msg/String",
    STATE: "std_msgs/msg/String",
    TAKEN: "std_msgs/msg/String",
}
_ENDS = (LiveState.IDLE, LiveState.ARRIVED, LiveState.CANCELLED)
_ADVICE = "free some space there, or choose another directory with hydra.run.dir=PATH"


class LiveRecorder:
    """Recorder of a driver's steps in `goal-1.mcap`, `goal-2.mcap`, …; use as a context manager.

    A file begins with the first decision on the way to its goal, and ends when the robot has arrived, or when the
    goal is cancelled or replaced. Stamps are those of the ticks; if the clock jumps back, they continue from the
    last. Methods raise InputError if the file cannot be written.
    """

    def __init__(self, folder: Path, config: DriveConfig, driver: LiveDriver) -> None:
        self._folder, self._config, self._driver = folder, config, driver
        self._open = ExitStack()
        self._writer: DecisionWriter | None = None
        self._goal = 0  # of the open file
        self._latest, self._shift = -1, 0  # [ns]
        self._written_state = ""
        self._previous_explanation: Explanation | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._close()

    def take(self, step: LiveStep) -> None:
        """Add a step, unless it repeats the previous one because the clock stands still."""
        # A new goal ends the file of the former; its own begins with its first decision.
        if self._writer is not None and step.goal != self._goal:
            self._close()
        if self._writer is None and step.observation is not None:
            self._begin(step)
        if self._writer is None:
            return
        time_ns = self._stamp(step)
        if time_ns is None:
            return
        # Write the decision, or only where the robot is, then what was sent.
        if step.observation is not None:
            self._decision(self._writer, step, time_ns)
        elif step.motion is not None:
            self._writer.motion(step.motion.pose, step.motion.twist, time_ns)
        self._writer.twist("/cmd_vel", step.command, time_ns)
        if step.text != self._written_state:
            self._written_state = step.text
            self._writer.text(STATE, step.text, time_ns)
        if step.state in _ENDS:
            self._close()

    def _begin(self, step: LiveStep) -> None:
        driver, robot = self._driver, self._driver.robot
        metadata = {
            "seed": driver.config.seed,
            "world": step.goal,
            "run": 0,
            "goal_tolerance": driver.config.goal_tolerance,
            "config": identity(replace(self._config, robot=robot)),
        }
        path = self._folder / f"goal-{step.goal}.mcap"
        file = self._open.enter_context(McapFile(path, LIVE_TOPICS, LATCHED, _ADVICE))
        self._writer = DecisionWriter(file, metadata, robot)
        self._goal, self._latest, self._shift = step.goal, -1, 0
        self._written_state, self._previous_explanation, self._before_first = "", None, True

    def _decision(self, writer: DecisionWriter, step: LiveStep, time_ns: int) -> None:
        assert step.observation is not None
        assert step.guidance is not None
        assert step.wanted is not None
        writer.decision(step.observation, step.guidance, time_ns)
        if self._before_first and step.observation.last_command is not None:
            writer.twist("/cmd_vel", step.observation.last_command, time_ns)
        self._before_first = False
        writer.text(TAKEN, str(step.taken), time_ns)
        writer.twist(WANTED, step.wanted, time_ns)
        if step.explanation is not None:
            writer.text(WHY, reason(step.explanation, self._previous_explanation), time_ns)
            self._previous_explanation = step.explanation

    def _stamp(self, step: LiveStep) -> int | None:
        """Return the stamp in the file [ns], later than all before it; None if the step is not new."""
        if step.stamp + self._shift == self._latest:
            return None
        # The clock has jumped back: continue one control period after the last stamp.
        if step.stamp + self._shift < self._latest:
            self._shift = self._latest + round(1e9 * self._driver.robot.dt) - step.stamp
        self._latest = step.stamp + self._shift
        return self._latest

    def _close(self) -> None:
        self._writer = None
        self._open.close()
