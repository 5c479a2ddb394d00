"""Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347) of a mixture policy, with many robots.

`ppo_training.py` implements it in torch, which nothing here imports.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lme.errors import require
from runners.learning.reinforcement import Reinforcement, ReinforcementConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


@dataclass(slots=True)
class PpoConfig(ReinforcementConfig):
    """Keys of `conf/learner/ppo.yaml`."""

    horizon: int = 128  # steps of every robot between two rounds of updates
    epochs: int = 4
    batch: int = 512
    decay: float = 0.95  # λ of the generalised advantage
    clip: float = 0.2
    kl_max: float = 0.03  # a round ends when the policy has changed more than this
    warm_up: int = 20_000  # steps in which only the critic is trained

    def __post_init__(self) -> None:
        self.check()
        for key in ("horizon", "epochs", "batch"):
            require(f"learner.{key}", getattr(self, key), at_least=1)
        for key in ("clip", "kl_max"):
            require(f"learner.{key}", getattr(self, key), above=0.0)
        require("learner.decay", self.decay, at_least=0.0, at_most=1.0)
        require("learner.warm_up", self.warm_up, at_least=0)


class Ppo(Reinforcement[PpoConfig]):
    """Learns from its own driving by small changes of the policy."""

    Config = PpoConfig

    def learn(self, run: Run) -> None:
        from runners.learning.ppo_training import PpoTraining

        PpoTraining(self._config).learn(run)
