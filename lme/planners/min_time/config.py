"""Settings of the minimum-time arcs."""

from __future__ import annotations

from dataclasses import dataclass

from lme.errors import config_key, require
from lme.inputs import plausibility


@dataclass(slots=True)
class MinTimeParts:
    """Parts of the planner; False leaves one out, for an ablation."""

    calm: bool
    backing_up: bool
    multi_point: bool


@dataclass(slots=True)
class MinTimeConfig:
    """Distances that the planner keeps, and properties of the robot on which it may rely."""

    margin: float
    margin_time: float
    brake: float
    max_lateral_accel: float
    latency: float
    lag: float
    parts: MinTimeParts

    def __post_init__(self) -> None:
        for key in ("margin", "margin_time", "latency", "lag"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("brake", "max_lateral_accel"):
            require(key, getattr(self, key), above=0.0)
        for key in ("latency", "lag"):
            plausibility.check(config_key(key), getattr(self, key))
