"""MAER-Nav and DRL-NSUO: local planners of one laboratory, trained by reinforcement learning."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lme.errors import argument_error, require
from lme.inputs.onnx_file import SignedNetwork
from lme.planners.commands import limited
from lme.planners.drl_vo.observation import binned, has_return
from lme.planners.ipaprec.weights import signature
from lme.robots import Robot
from lme.types import Floats, Guidance, LaserScan, Observation, Twist


@dataclass(slots=True)
class IpapRecConfig:
    """Network, its view of the scan, and the velocities for its output."""

    weights: str | None
    sectors: int
    fov: float
    no_return: float
    v_min: float
    v_max: float
    omega_max: float

    def __post_init__(self) -> None:
        require("sectors", self.sectors, at_least=1)
        for key in ("fov", "no_return", "v_max", "omega_max"):
            require(key, getattr(self, key), above=0.0)
        require("fov", self.fov, at_most=math.tau)
        require("v_min", self.v_min, at_most=0.0)


class IpapRec:
    """MAER-Nav (arXiv 2503.23908) and DRL-NSUO, the network alone.

    Network, observation and action are those of the authors' code; the action is the mean of the policy, without noise.
    The network drives to the guide's subgoal. It is given the speed without its sign, and has no notion of arrival. The
    command is limited to what the robot can reach in a period.
    """

    Config = IpapRecConfig

    def __init__(self, config: IpapRecConfig, robot: Robot) -> None:
        if config.weights is None:
            raise argument_error(
                "weights is null: the authors' networks do not ship with lme; import one with "
                "`lme weights import maer_nav PATH` or `lme weights import drl_nsuo PATH`"
            )
        self._network = SignedNetwork(Path(config.weights), signature(config.sectors))
        self._config = config
        self._robot = robot

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; there is nothing to forget, and `rng` is not used."""

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        config = self._config
        ranges = nearest_by_sector(observation.scan, self._robot.lidar.yaw, config)
        x, y = guidance.subgoal
        v, omega = observation.twist
        state = np.array([math.hypot(x, y), math.atan2(y, x), abs(v), omega])
        (mean,) = self._network.answer(ranges, state)
        forward, turn = mean.tolist()
        v = config.v_min + (forward + 1.0) / 2.0 * (config.v_max - config.v_min)
        return limited(v, turn * config.omega_max, observation, self._robot.dt)


def nearest_by_sector(scan: LaserScan, mount_yaw: float, config: IpapRecConfig) -> Floats:
    """Nearest return in each sector about the lidar, from the right to the left: (sectors,) [m]."""
    arguments = (
        scan.angle_min + mount_yaw,
        scan.angle_increment,
        len(scan.ranges),
        config.fov,
        config.sectors,
    )
    beams, sectors = binned(*arguments)
    nearest = np.full(config.sectors, config.no_return)
    ranges = np.where(has_return(scan), np.minimum(scan.ranges, config.no_return), config.no_return)
    np.minimum.at(nearest, sectors, ranges[beams])
    return nearest
