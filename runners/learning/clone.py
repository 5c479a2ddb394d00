"""Cloning by DAgger (Ross, Gordon and Bagnell 2011): an expert labels the states that it and the network visit.

The expert drives round 0. In later rounds the network drives more and more, so that the expert also labels the states
to which the network's mistakes lead. `clone_training.py` implements this in torch, which nothing here imports.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from lme.errors import InputError, require
from runners.config.schema import LearnConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


@dataclass(slots=True)
class ExpertConfig:
    """Options of planner and guide. guide: used if the network's subgoal is the target; None: the network's guide.

    settings: keys of the planner whose values differ from those in the option's file.
    """

    planner: str = "dwa_tuned"
    guide: str | None = None
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(slots=True)
class CloneConfig:
    """Keys of `conf/learner/clone.yaml`."""

    rounds: int = 6
    episodes: int = 300  # per round
    updates: list[int] = field(default_factory=lambda: [2000, 6000])  # in the first and in the last round
    batch: int = 256
    lr: float = 1e-3  # of Adam; it falls to a hundredth in every round
    beta: float = 0.5  # in round n the expert drives beta^n of the steps
    least_beta: float = 0.1
    least_sigma: float = 0.03  # minimum deviation
    sharpness: float = 10.0  # of the draw of components while the network drives
    mirror: bool = True  # half of every batch is mirrored
    time_limit: float | None = 40.0  # [s] of an episode that is collected
    failures: bool = True  # learn also from episodes that do not succeed
    expert: ExpertConfig = field(default_factory=ExpertConfig)

    def __post_init__(self) -> None:
        for key in ("rounds", "episodes", "batch"):
            require(f"learner.{key}", getattr(self, key), at_least=1)
        for key in ("lr", "least_sigma", "sharpness"):
            require(f"learner.{key}", getattr(self, key), above=0.0)
        for key in ("beta", "least_beta"):
            require(f"learner.{key}", getattr(self, key), at_least=0.0, at_most=1.0)
        if self.time_limit is not None:
            require("learner.time_limit", self.time_limit, above=0.0)
        if len(self.updates) != 2 or min(self.updates) < 1:
            raise InputError(f"learner.updates is {self.updates}: must be [first, last], each at least 1")

    def in_round(self, number: int) -> tuple[int, float]:
        """Updates of a round, counted from 0, and the expert's share of the driving."""
        first, last = self.updates
        updates = round(first + (last - first) * number / max(self.rounds - 1, 1))
        return updates, 1.0 if number == 0 else max(self.beta**number, self.least_beta)


class Clone:
    """Learns to do what an expert would do, by the likelihood of the expert's actions."""

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
