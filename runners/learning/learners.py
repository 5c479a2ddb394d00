"""The learners of `conf/learner/`, and their keys. Their trainings are in torch, which nothing here imports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from lme.errors import InputError, require
from lme.gym.episodes import Reward
from runners.config.schema import LearnConfig

if TYPE_CHECKING:
    from runners.learning.run import Run


@dataclass(slots=True)
class ExpertConfig:
    """Expert's options. guide: used if the network's subgoal is the target; None: the network's guide.

    settings: keys of the planner with other values than in the option's file.
    """

    planner: str
    guide: str | None
    settings: dict[str, Any]


@dataclass(slots=True)
class CloneConfig:
    """Keys of `conf/learner/clone.yaml`."""

    rounds: int
    episodes: int
    updates: list[int]
    batch: int
    lr: float
    beta: float
    least_beta: float
    least_sigma: float
    sharpness: float
    mirror: bool
    time_limit: float | None
    failures: bool
    expert: ExpertConfig

    def __post_init__(self) -> None:
        for key in ("rounds", "episodes", "batch"):
            require(key, getattr(self, key), at_least=1)
        for key in ("lr", "least_sigma", "sharpness"):
            require(key, getattr(self, key), above=0.0)
        for key in ("beta", "least_beta"):
            require(key, getattr(self, key), at_least=0.0, at_most=1.0)
        if self.time_limit is not None:
            require("time_limit", self.time_limit, above=0.0)
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

    progress: float
    success: float
    collision: float
    timeout: float
    step: float


@dataclass(slots=True)
class Curriculum:
    """Easier tasks first: in each stage, reaching a distance `within` from the goal counts as success.

    within: distance [m] of each stage; the last stage has the map's own tolerance. promote: share of successes in
    the last hundred episodes that ends a stage.
    """

    within: list[float]
    promote: float

    def __post_init__(self) -> None:
        for distance in self.within:
            require("within", distance, above=0.0)
        require("promote", self.promote, above=0.0, at_most=1.0)


@dataclass(slots=True)
class ReinforcementConfig:
    """Keys common to `conf/learner/ppo.yaml` and `sac.yaml`."""

    steps: int
    robots: int
    worlds: int
    judge_every: int
    lr: float
    gamma: float
    least_sigma: float
    reward: DclpReward
    curriculum: Curriculum

    def check(self) -> None:
        """Raise InputError for invalid values."""
        for key in ("steps", "robots", "worlds", "judge_every"):
            require(key, getattr(self, key), at_least=1)
        for key in ("lr", "least_sigma"):
            require(key, getattr(self, key), above=0.0)
        require("gamma", self.gamma, at_least=0.0, at_most=1.0)


@dataclass(slots=True)
class PpoConfig(ReinforcementConfig):
    """Keys of `conf/learner/ppo.yaml`."""

    horizon: int
    epochs: int
    batch: int
    decay: float
    clip: float
    kl_max: float
    warm_up: int

    def __post_init__(self) -> None:
        self.check()
        for key in ("horizon", "epochs", "batch"):
            require(key, getattr(self, key), at_least=1)
        for key in ("clip", "kl_max"):
            require(key, getattr(self, key), above=0.0)
        require("decay", self.decay, at_least=0.0, at_most=1.0)
        require("warm_up", self.warm_up, at_least=0)


@dataclass(slots=True)
class SacConfig(ReinforcementConfig):
    """Keys of `conf/learner/sac.yaml`."""

    alpha: float
    polyak: float
    batch: int
    updates: int
    replay: int
    warm_up: int
    critics_first: int

    def __post_init__(self) -> None:
        self.check()
        for key in ("batch", "updates", "replay"):
            require(key, getattr(self, key), at_least=1)
        require("alpha", self.alpha, at_least=0.0)
        require("polyak", self.polyak, above=0.0, at_most=1.0)
        for key in ("warm_up", "critics_first"):
            require(key, getattr(self, key), at_least=0)


Settings = TypeVar("Settings", bound=ReinforcementConfig)


class Reinforcement(Generic[Settings]):
    """Common part of ppo and sac, which each add `learn`."""

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


class Clone:
    """Cloning by DAgger (Ross, Gordon and Bagnell 2011): an expert labels the states that it and the network visit.

    The expert drives round 0. In later rounds the network drives more and more, so that the expert also labels the
    states to which the network's mistakes lead.
    """

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


class Ppo(Reinforcement[PpoConfig]):
    """Proximal policy optimisation (Schulman et al. 2017, arXiv:1707.06347) with many robots, by small changes."""

    Config = PpoConfig

    def learn(self, run: Run) -> None:
        from runners.learning.ppo_training import PpoTraining

        PpoTraining(self._config).learn(run)


class Sac(Reinforcement[SacConfig]):
    """Soft actor-critic (Haarnoja et al. 2018, arXiv:1801.01290) of a mixture policy, as DRL-DCLP was trained."""

    Config = SacConfig

    def learn(self, run: Run) -> None:
        from runners.learning.sac_training import SacTraining

        SacTraining(self._config).learn(run)
