"""Cloning by DAgger (Ross, Gordon and Bagnell 2011): an expert labels the states that it and the network visit.

The expert drives round 0. In later rounds the network drives more and more, so that the expert also labels the states
to which the network's mistakes lead. `clone_training.py` implements this in torch, which nothing here imports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from runners.config.schema import LearnConfig
from runners.learning.settings import CloneConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


class Clone:
    """Learner that imitates an expert, by the likelihood of the expert's actions."""

    Config = CloneConfig

    def __init__(self, config: CloneConfig) -> None:
        self._config = config

    @property
    def total(self) -> int:
        return self._config.rounds

    @property
    def expert(self) -> Mapping[str, Any] | None:
        return asdict(self._config.expert)

    def check(self, config: LearnConfig) -> None:
        """Accept every simulator."""

    def learn(self, run: Run) -> None:
        from runners.learning.clone_training import CloneTraining

        CloneTraining(self._config).learn(run)
