"""What every simulator offers."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from lme.types import Floats, Observation, Pose, Twist
from lme.worlds.world import Task


class State(NamedTuple):
    """The truth after a reset or a step.

    time: since reset [s]. travel: (K, 3) poses passed in the last period, the last of them `pose`.
    clearance: least distance from footprint to obstacle over the period [m]; 0 in contact.
    """

    pose: Pose
    twist: Twist
    time: float
    travel: Floats
    clearance: float
    contact: bool
    arrived: bool


class Simulator(Protocol):
    """A robot in a world. Owns its state; `state` is the truth, which no guide or planner sees."""

    state: State

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, at rest."""

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact or arrival, whichever comes first."""
