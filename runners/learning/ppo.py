"""Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347) of a mixture policy, with many robots.

`ppo_training.py` implements it in torch, which nothing here imports.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from runners.learning.reinforcement import Reinforcement
from runners.learning.settings import PpoConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


class Ppo(Reinforcement[PpoConfig]):
    """Learner from its own driving, by small changes of the policy."""

    Config = PpoConfig

    def learn(self, run: Run) -> None:
        from runners.learning.ppo_training import PpoTraining

        PpoTraining(self._config).learn(run)
