"""LME+ as a guide."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.guides.lme.weight_files import PUBLISHED, learned_parameters
from lme.guides.lme_plus.escaper import EscaperPlusConfig, LocalMinimumEscaperPlus
from lme.robots import Robot
from lme.types import Guidance, Observation


@dataclass(slots=True)
class LmePlusConfig(EscaperPlusConfig):
    """An escaper's settings, its own weight set, and its parameters by name; {}: those of the weight set."""

    weight_set: str = "lme_plus"
    parameters: dict[str, float] = field(default_factory=dict)


class LmePlus:
    """The successor of LME: candidates scored by expected time (docs/lme_plus.md)."""

    Config = LmePlusConfig

    def __init__(self, config: LmePlusConfig, robot: Robot) -> None:
        parameters = config.parameters or learned_parameters(PUBLISHED, config.weight_set)
        self.escaper = LocalMinimumEscaperPlus(robot, parameters, config)

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` draws the candidates."""
        self.escaper.reset(rng)

    def guide(self, observation: Observation) -> Guidance:
        """Return the subgoal with the least expected time, the known obstacle points, and the fastest way."""
        decision, points, route = self.escaper.decide(observation)
        return Guidance(decision.subgoal, None, decision.choice.switched, decision.blocked, points, route)

    def explanation(self) -> Explanation | None:
        """All quantities behind the last decision; None before the first."""
        return self.escaper.explanation()
