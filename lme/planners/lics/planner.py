"""LiCS-KI: an imitation-learned transformer along a global path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lme.errors import require
from lme.inputs.onnx_file import SignedNetwork
from lme.inputs.resources import resource_dir
from lme.planners.commands import limited
from lme.planners.lics.observation import FRONT, direction_along, sweep
from lme.planners.lics.weights import SIGNATURE
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

SHIPPED = "lics_ki.onnx"  # in conf/network/


@dataclass(slots=True)
class LicsConfig:
    """Weights of the network, its observation, and the velocities for its output; the authors' names."""

    weights: str | None
    los: float
    laser_clip: float
    threshold_dist: float
    max_v: float
    min_v: float
    max_w: float

    def __post_init__(self) -> None:
        for key in ("los", "laser_clip", "threshold_dist", "max_v", "max_w"):
            require(key, getattr(self, key), above=0.0)
        require("min_v", self.min_v, at_most=0.0)


class Lics:
    """LiCS (Damanik et al. 2025, RA-L, arXiv 2406.14947), as it won the BARN Challenge of 2024.

    Network, observation and action are those of the authors' entry, LiCS-KI: a sweep of 720 beams and the direction of
    a point on the global path give a velocity, which falls with the least range within 40° of straight ahead. While
    the guide finds no path, the direction stays the same in the robot frame. The entry has no recovery, and no
    notion of arrival. The command is limited to what the robot can reach in a period.
    """

    Config = LicsConfig

    def __init__(self, config: LicsConfig, robot: Robot) -> None:
        path = Path(config.weights) if config.weights else resource_dir("conf") / "network" / SHIPPED
        self._network = SignedNetwork(path, SIGNATURE)
        self._config = config
        self._robot = robot

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the direction."""
        self._direction: Floats = np.zeros(2)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        config = self._config
        ranges = sweep(observation.scan, self._robot.lidar.yaw, config.laser_clip)
        if not guidance.blocked:
            path = guidance.path if guidance.path is not None else guidance.subgoal[None]
            self._direction = direction_along(path, config.los)
        (velocity,) = self._network.answer(ranges, self._direction)
        v, omega = velocity.tolist()
        v *= config.max_v * min(float(ranges[FRONT].min()) / config.threshold_dist, 1.0)
        v, omega = min(max(v, config.min_v), config.max_v), omega * config.max_w
        omega = min(max(omega, -config.max_w), config.max_w)
        return limited(v, omega, observation, self._robot.dt)
