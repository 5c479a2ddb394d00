"""Config of DRL-VO."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lme.errors import require


@dataclass(slots=True)
class DrlVoConfig:
    """Network, its observation, and the meaning of its outputs."""

    weights: str | None = None  # path of an ONNX file
    deterministic: bool = False  # the mean of the action; false: draw it
    sweep_rate: float = 20.0  # [Hz]
    fov: float = math.pi  # [rad] of the sweeps
    range_max: float = 30.0  # [m] longer ranges become this one
    no_return: float = 0.0  # [m] range of a beam without return
    pedestrians: bool = True  # show the pedestrians to the network
    lookahead: float = 2.0  # [m] of the sub-goal
    goal_margin: float = 0.15  # [m] the robot stops this close to the goal
    stop_range: float = 0.4  # [m] at shorter ranges ahead it turns in place
    stop_turn: float = 0.7  # [rad/s] this fast
    v_max: float = 0.5  # [m/s] of the greatest output
    omega_max: float = 2.0  # [rad/s] of the greatest output
    v_free: float | None = None  # [m/s] v_max where it is free ahead; None: the same
    free_range: float = 2.2  # [m] "free ahead": no shorter range

    def __post_init__(self) -> None:
        for key in ("sweep_rate", "fov", "range_max", "lookahead", "v_max", "omega_max", "free_range"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in ("goal_margin", "stop_range", "stop_turn"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        require("planner.fov", self.fov, at_most=math.tau)
        require("planner.no_return", self.no_return, at_least=0.0, at_most=self.range_max)
        if self.v_free is not None:
            require("planner.v_free", self.v_free, above=0.0)
