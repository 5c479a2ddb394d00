"""DRL-DCLP: a local planner trained by reinforcement learning for any rectangular robot and any limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lme.inputs.onnx_file import SignedNetwork
from lme.inputs.resources import resource_dir
from lme.planners.dclp.interface import DclpConfig, DclpFeatures, DclpInterface, warn_if_untrained
from lme.planners.dclp.network import Mixture, draw
from lme.planners.dclp.weights import SIGNATURE
from lme.robots import Robot
from lme.types import Guidance, Observation, Twist

SHIPPED = "dclp_jackal.onnx"  # in conf/network/; lme learn made it


class Dclp:
    """DRL-DCLP (Zhang et al. 2025, RA-L, DOI 10.1109/LRA.2025.3544927), the network alone.

    Network, observation and action are those of the authors' code. The network may drive in reverse. It has no
    notion of arrival. The command is limited to what the robot can reach in a period. Along a guide's path the
    subgoal is the first point at least `lookahead` away.
    """

    Config = DclpConfig

    def __init__(self, config: DclpConfig, robot: Robot) -> None:
        shipped = resource_dir("conf") / "network" / SHIPPED
        self._network = SignedNetwork(shipped if config.weights is None else Path(config.weights), SIGNATURE)
        self.interface = DclpInterface(config, robot)
        self.seen: DclpFeatures | None = None  # inputs of the network at the last step
        warn_if_untrained(self.interface.reported_limits, self._network.trained)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode with the generator that draws the mixture's components."""
        self._rng = rng

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        self.seen = self.interface.features(observation, self.interface.goal(guidance))
        return self.interface.command(
            draw(Mixture(*self._network.answer(*self.seen)), self._rng), observation
        )
