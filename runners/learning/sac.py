"""Soft actor-critic (Haarnoja et al. 2018, arXiv:1801.01290) of a mixture policy, as DRL-DCLP was trained.

`sac_training.py` implements it in torch, which nothing here imports.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from runners.learning.reinforcement import Reinforcement
from runners.learning.settings import SacConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


class Sac(Reinforcement[SacConfig]):
    """Learner from a memory of its own driving, with a reward for exploration."""

    Config = SacConfig

    def learn(self, run: Run) -> None:
        from runners.learning.sac_training import SacTraining

        SacTraining(self._config).learn(run)
