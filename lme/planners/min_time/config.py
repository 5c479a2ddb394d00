"""Settings of the minimum-time arcs."""

from __future__ import annotations

from dataclasses import dataclass

from lme import plausibility
from lme.errors import require
from lme.planners.commands import MOST_SAMPLES, check_turn_samples


@dataclass(slots=True)
class MinTimeConfig:
    """Estimate of the time to the subgoal, safety, and sampling of the commands."""

    horizon: float = 0.5  # [s] a command is held for up to this time
    turn: float = 0.5  # [s/rad] expected time to turn to the subgoal after that
    margin: float = 0.05  # [m] distance to obstacle points at rest
    margin_time: float = 0.1  # [s] further distance per speed of the outline
    brake: float = 3.0  # [m/s²] deceleration that the robot can rely on, at most its limit
    grip: float = 1.0  # [m/s²] greatest v·|ω|, the lateral acceleration
    calm: float = 10.0  # [rad/s²] greatest turn acceleration, but near obstacles and where people move
    near: float = 0.15  # [m] distance to obstacle points at which it uses all that the robot has
    back: float = 0.3  # [m] distance that a stuck robot backs up at least; 0: never
    multi_point: float = 2.0  # [s] without a free way after which it makes a multi-point turn; 0: never
    latency: float = 0.0  # [s] known delay from a command to its effect
    lag: float = 0.0  # [s] known time constant with which the velocity then approaches the command
    v_samples: int = 7
    omega_samples: int = 15  # odd, so that one of them is in the middle

    def __post_init__(self) -> None:
        for key in ("turn", "margin", "margin_time", "near", "back", "multi_point", "latency", "lag"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        for key in ("horizon", "brake", "grip", "calm"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        require("planner.v_samples", self.v_samples, at_least=2, at_most=MOST_SAMPLES)
        check_turn_samples(self.omega_samples)
        for key in ("latency", "lag"):
            plausibility.check(f"planner.{key}", getattr(self, key))
