"""A guide that sends the planner straight to the target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lme.robots import Robot
from lme.types import Guidance, Observation


@dataclass(slots=True)
class TargetConfig:
    """No settings."""


class Target:
    """Guide whose subgoal is always the target."""

    Config = TargetConfig

    def __init__(self, config: TargetConfig, robot: Robot) -> None:
        pass

    def reset(self, rng: np.random.Generator) -> None:
        """Do nothing: there is no state."""

    def guide(self, observation: Observation) -> Guidance:
        """Return the target as the subgoal."""
        return Guidance(observation.target)
