"""Settings of the minimum-time arcs."""

from __future__ import annotations

from dataclasses import dataclass, field

from lme.errors import require
from lme.inputs import plausibility


@dataclass(slots=True)
class MinTimeParts:
    """Parts of the planner; False leaves one out, for an ablation."""

    calm: bool = True  # turns, away from obstacles and people
    back: bool = True  # it backs up where it is stuck
    multi_point: bool = True  # turns where it has had no free way for some time


@dataclass(slots=True)
class MinTimeConfig:
    """Distances that the planner keeps, and properties of the robot on which it may rely."""

    margin: float = 0.05  # [m] distance to obstacle points at rest
    margin_time: float = 0.1  # [s] further distance per speed of the outline
    brake: float = 3.0  # [m/s²] deceleration that the robot can rely on, at most its limit
    grip: float = 1.0  # [m/s²] greatest v·|ω|, the lateral acceleration
    latency: float = 0.0  # [s] known delay from a command to its effect
    lag: float = 0.0  # [s] known time constant with which the velocity then approaches the command
    parts: MinTimeParts = field(default_factory=MinTimeParts)

    def __post_init__(self) -> None:
        for key in ("margin", "margin_time", "latency", "lag"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        for key in ("brake", "grip"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in ("latency", "lag"):
            plausibility.check(f"planner.{key}", getattr(self, key))
