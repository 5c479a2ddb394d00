"""The shape of every command's config, and the resolver that names parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import OmegaConf

from lme.robots import Robot


@dataclass(slots=True)
class EvalConfig:
    """`lme eval`. Groups that hold a `_target_` are checked against that class's Config."""

    seed: int
    runs: int
    weights: str
    resume: Any
    robot: Robot
    map: dict[str, Any]
    guide: dict[str, Any]
    planner: dict[str, Any]
    sim: dict[str, Any]
    ablation: dict[str, float]
    executor: dict[str, Any]
    tracking: dict[str, Any]
    system: dict[str, Any] = field(default_factory=dict)
    table: list[str] = field(default_factory=list)


@dataclass(slots=True)
class Reward:
    """What a failed episode is worth (paper eq. 1), and how long one may take."""

    crash: float
    timeout: float
    max_steps: int | None


@dataclass(slots=True, kw_only=True)
class TrainConfig(EvalConfig):
    """`lme train`. held_out: map sets by name; space: nested as the config that it searches."""

    trials: int
    configurations: int
    training_numbers: list[int]
    start_from_config: bool
    reward: Reward
    name: str | None
    storage: str | None
    study: str | None
    search: dict[str, Any]
    space: dict[str, Any]
    held_out: dict[str, Any] = field(default_factory=dict)


def register() -> None:
    """Make the schemas and the `parameters` resolver known to Hydra; safe to call again."""
    from runners.weights import parameters

    ConfigStore.instance().store(name="eval_schema", node=EvalConfig)
    ConfigStore.instance().store(name="train_schema", node=TrainConfig)
    OmegaConf.register_new_resolver("parameters", parameters, replace=True)
