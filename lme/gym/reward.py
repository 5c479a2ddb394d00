"""Reward of a step and result of an episode."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import require
from lme.gym.kernels import COLLISION, RUNNING, SUCCESS, TIMEOUT
from lme.metrics import barn_metric
from lme.types import Floats, Ints, Outcome

OUTCOMES = {SUCCESS: Outcome.SUCCESS, COLLISION: Outcome.COLLISION, TIMEOUT: Outcome.TIMEOUT}
CODES: dict[Outcome | None, int] = {None: RUNNING} | {outcome: code for code, outcome in OUTCOMES.items()}


@dataclass(slots=True)
class Reward:
    """Terms of the reward. The defaults are those of ros_jackal: progress, +20 for arrival, −1 for a collision."""

    progress: float = 1.0  # [1/m] per metre that the robot came nearer to the goal, in a straight line
    success: float = 20.0  # at arrival
    collision: float = -1.0  # at contact
    timeout: float = 0.0  # at the time limit
    step: float = 0.0  # at every step

    def __post_init__(self) -> None:
        for key in ("progress", "success", "collision", "timeout", "step"):
            require(f"reward.{key}", getattr(self, key))

    def of(self, previous: Floats, current: Floats, outcomes: Ints) -> Floats:
        """Rewards (N,). previous, current (N,): distances to the goal [m]; outcomes (N,): see `lme.gym.kernels`."""
        ends = np.array([0.0, self.success, self.collision, self.timeout])
        return self.progress * (previous - current) + (self.step + ends[outcomes])


class Result(NamedTuple):
    """Result of an episode. time: on the task's clock [s]; path_length [m]; optimal_time: the task's [s]."""

    outcome: Outcome
    world: int
    time: float
    path_length: float
    steps: int
    optimal_time: float

    def info(self) -> dict[str, Any]:
        """Return the entries of Gymnasium's info at an episode's end; `is_success` is Stable-Baselines3's name."""
        success = self.outcome is Outcome.SUCCESS
        metric = (
            math.nan if math.isnan(self.optimal_time) else barn_metric(success, self.time, self.optimal_time)
        )
        return {
            "outcome": str(self.outcome),
            "is_success": success,
            "barn_metric": metric,
            "optimal_time": self.optimal_time,
            "time": self.time,
            "path_length": self.path_length,
            "steps": self.steps,
            "world": self.world,
        }


def distances(goals: Floats, positions: NDArray[np.float64]) -> Floats:
    """Distances (N,) from positions (N, 2) to goals (N, 2) [m]."""
    return np.hypot(goals[:, 0] - positions[:, 0], goals[:, 1] - positions[:, 1])
