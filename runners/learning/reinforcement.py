"""The keys and properties that ppo and sac share. Nothing here imports torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from lme.envs.reward import Reward
from lme.errors import require
from runners.config.schema import LearnConfig

Settings = TypeVar("Settings", bound="ReinforcementConfig")


@dataclass(slots=True)
class DclpReward(Reward):
    """The reward with which DRL-DCLP was trained."""

    progress: float = 2.0
    success: float = 10.0
    collision: float = -10.0


@dataclass(slots=True)
class Curriculum:
    """Easier tasks first: in each stage, coming within `within` of the goal is a success.

    within: [m] of each stage; the last stage has the map's own tolerance. promote: success in the last hundred
    episodes that ends a stage.
    """

    within: list[float] = field(default_factory=list)
    promote: float = 0.8

    def __post_init__(self) -> None:
        for distance in self.within:
            require("learner.curriculum.within", distance, above=0.0)
        require("learner.curriculum.promote", self.promote, above=0.0, at_most=1.0)


@dataclass(slots=True)
class ReinforcementConfig:
    """Keys common to `conf/learner/ppo.yaml` and `sac.yaml`."""

    steps: int = 1_000_000  # of all robots together
    robots: int = 32  # that drive at once
    worlds: int = 1000  # that they drive in
    judge_every: int = 50_000  # steps
    lr: float = 1e-4  # of Adam
    gamma: float = 0.99
    least_sigma: float = 0.1  # before tanh
    reward: DclpReward = field(default_factory=DclpReward)
    curriculum: Curriculum = field(default_factory=Curriculum)

    def check(self) -> None:
        """Raise InputError for invalid values."""
        for key in ("steps", "robots", "worlds", "judge_every"):
            require(f"learner.{key}", getattr(self, key), at_least=1)
        for key in ("lr", "least_sigma"):
            require(f"learner.{key}", getattr(self, key), above=0.0)
        require("learner.gamma", self.gamma, at_least=0.0, at_most=1.0)


class Reinforcement(Generic[Settings]):
    """What ppo and sac have in common; each adds `learn`."""

    def __init__(self, config: Settings) -> None:
        self._config = config

    @property
    def total(self) -> int:
        return self._config.steps

    @property
    def expert(self) -> Mapping[str, Any] | None:
        return None

    def check(self, config: LearnConfig) -> None:
        from runners.learning.driving import check_driving

        check_driving(config)
