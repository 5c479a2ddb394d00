"""Keys and properties that ppo and sac share. Nothing here imports torch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from runners.config.schema import LearnConfig
from runners.learning.settings import ReinforcementConfig

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
