"""Config of DRL-VO."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lme.errors import require


@dataclass(slots=True)
class DrlVoConfig:
    """Network, its observation, and the meaning of its outputs."""

    weights: str | None
    deterministic: bool
    sweep_rate: float
    fov: float
    range_max: float
    no_return: float
    pedestrians: bool
    lookahead: float
    goal_margin: float
    stop_range: float
    stop_turn: float
    v_max: float
    omega_max: float
    v_free: float | None
    free_range: float

    def __post_init__(self) -> None:
        for key in ("sweep_rate", "fov", "range_max", "lookahead", "v_max", "omega_max", "free_range"):
            require(key, getattr(self, key), above=0.0)
        for key in ("goal_margin", "stop_range", "stop_turn"):
            require(key, getattr(self, key), at_least=0.0)
        require("fov", self.fov, at_most=math.tau)
        require("no_return", self.no_return, at_least=0.0, at_most=self.range_max)
        if self.v_free is not None:
            require("v_free", self.v_free, above=0.0)
