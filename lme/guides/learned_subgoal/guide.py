"""A guide whose subgoals come from a network."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lme.guides.learned_subgoal.interface import LearnedSubgoalConfig, SubgoalInterface, warn_if_untrained
from lme.guides.learned_subgoal.network import draw
from lme.guides.learned_subgoal.weights import SIGNATURE
from lme.inputs.onnx_file import SignedNetwork
from lme.inputs.resources import resource_dir
from lme.robots import Robot
from lme.types import Guidance, Observation

SHIPPED = "learned_subgoal.onnx"  # `lme learn experiment=learn/learned_subgoal` made it


class LearnedSubgoal:
    """Hierarchical reinforcement learning with intermediate targets: the upper level, for any planner.

    Once per `period`, a network trained by PPO gives a probability to each candidate of a polar grid around the robot
    to which a straight way is free, and one is drawn. In between, the subgoal stays in place.
    """

    Config = LearnedSubgoalConfig

    def __init__(self, config: LearnedSubgoalConfig, robot: Robot) -> None:
        shipped = resource_dir("conf") / "network" / SHIPPED
        self._network = SignedNetwork(shipped if config.weights is None else Path(config.weights), SIGNATURE)
        self._interface = SubgoalInterface(config, robot)
        self._left = 0
        warn_if_untrained(robot, self._network.trained)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self._rng, self._left = rng, 0
        self._interface.clear()

    def guide(self, observation: Observation) -> Guidance:
        """Return the subgoal chosen now or in one of the last control periods."""
        if self._left == 0:
            seen = self._interface.features(observation, observation.target)
            (logits,) = self._network.answer(*seen)
            self._interface.choose(draw(logits, self._rng))
            self._left = self._interface.steps
        self._left -= 1
        return self._interface.guidance(observation)
