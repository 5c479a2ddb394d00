"""Keys of the learners in `conf/learner/`. Nothing here imports torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lme.errors import InputError, require
from lme.gym.reward import Reward


@dataclass(slots=True)
class ExpertConfig:
    """Expert's options. guide: used if the network's subgoal is the target; None: the network's guide.

    settings: keys of the planner with other values than in the option's file.
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
        """Return the updates of a round, counted from 0, and the expert's share of the driving."""
        first, last = self.updates
        updates = round(first + (last - first) * number / max(self.rounds - 1, 1))
        return updates, 1.0 if number == 0 else max(self.beta**number, self.least_beta)


@dataclass(slots=True)
class DclpReward(Reward):
    """Reward with which DRL-DCLP was trained."""

    progress: float = 2.0
    success: float = 10.0
    collision: float = -10.0


@dataclass(slots=True)
class Curriculum:
    """Easier tasks first: in each stage, reaching a distance `within` from the goal counts as success.

    within: distance [m] of each stage; the last stage has the map's own tolerance. promote: share of successes in
    the last hundred episodes that ends a stage.
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
