"""Soft actor-critic (Haarnoja et al. 2018, arXiv:1801.01290) of a mixture policy, as DRL-DCLP was trained.

`sac_training.py` implements it in torch, which nothing here imports.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from lme.errors import require
from runners.learning.reinforcement import Reinforcement, ReinforcementConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


@dataclass(slots=True)
class SacConfig(ReinforcementConfig):
    """Keys of `conf/learner/sac.yaml`."""

    steps: int = 300_000
    robots: int = 8
    judge_every: int = 20_000
    alpha: float = 0.01  # weight of entropy
    polyak: float = 0.005  # weight of the critics in an update of their targets
    batch: int = 256
    updates: int = 8  # after every step of all robots
    replay: int = 100_000  # steps kept
    warm_up: int = 5000  # steps before the first update
    critics_first: int = 2000  # updates of the critics before the policy's first

    def __post_init__(self) -> None:
        self.check()
        for key in ("batch", "updates", "replay"):
            require(f"learner.{key}", getattr(self, key), at_least=1)
        require("learner.alpha", self.alpha, at_least=0.0)
        require("learner.polyak", self.polyak, above=0.0, at_most=1.0)
        for key in ("warm_up", "critics_first"):
            require(f"learner.{key}", getattr(self, key), at_least=0)


class Sac(Reinforcement[SacConfig]):
    """Learns from a memory of its own driving, with a reward for exploration."""

    Config = SacConfig

    def learn(self, run: Run) -> None:
        from runners.learning.sac_training import SacTraining

        SacTraining(self._config).learn(run)
