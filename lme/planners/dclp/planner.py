"""DRL-DCLP: a local planner trained by reinforcement learning for any rectangular robot and any limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lme.inputs.resources import resource_dir
from lme.planners.dclp.interface import DclpConfig, DclpFeatures, DclpInterface, warn_if_untrained
from lme.planners.dclp.network import DclpPolicy, draw
from lme.planners.dclp.weights import TRAINED, read_weights
from lme.robots import Robot
from lme.types import Guidance, Observation, Twist

SHIPPED = "dclp_jackal.npz"  # in conf/network/; lme learn made it


class Dclp:
    """DRL-DCLP (Zhang et al. 2025, RA-L, DOI 10.1109/LRA.2025.3544927), the network alone.

    Network, observation and action are those of the authors' code. The network may drive in reverse. It has no
    notion of arrival. The command is limited to what the robot can reach in a period. Along a guide's path the
    subgoal is the first point at least `lookahead` away.
    """

    Config = DclpConfig

    def __init__(self, config: DclpConfig, robot: Robot) -> None:
        weights = _weights(config.weights)
        self._network = DclpPolicy(weights)
        self.interface = DclpInterface(config, robot)
        self.seen: DclpFeatures | None = None  # inputs of the network at the last step
        warn_if_untrained(self.interface.told, weights[TRAINED])

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode with the generator that draws the mixture's components."""
        self._rng = rng

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        self.seen = self.interface.features(observation, self.interface.goal(guidance))
        return self.interface.command(draw(self._network.mixture(*self.seen), self._rng), observation)


def _weights(path: str | None) -> dict[str, np.typing.NDArray[np.float32]]:
    return read_weights(Path(path) if path is not None else resource_dir("conf") / "network" / SHIPPED)
