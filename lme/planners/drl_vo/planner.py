"""DRL-VO: a local planner learned by reinforcement that sees past scans and pedestrians and follows a global path."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lme.errors import InputError, require
from lme.kernels.polyline import leaves
from lme.planners.array_file import Arrays
from lme.planners.commands import limited
from lme.planners.drl_vo.network import BATCH_NORMS, Network
from lme.planners.drl_vo.observation import Sweeps, free_ahead, image_of, velocity_maps
from lme.planners.drl_vo.weights import read_weights
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

_TRAINED = {"v_max": 0.5, "omega_max": 2.0}  # [m/s, rad/s] the authors' training environment
_NOWHERE = np.zeros(2)
_NOBODY = np.empty((0, 4))


@dataclass(slots=True)
class DrlVoConfig:
    """The network, what it sees, and what its answers mean."""

    weights: str | None = None  # path of an .npz
    batch_norm: str = "sample"  # "sample": statistics of the present feature maps; "running": of the training
    deterministic: bool = False  # the mean of the action; false: draw it
    sweep_rate: float = 20.0  # [Hz]
    fov: float = math.pi  # [rad] of the sweeps
    range_max: float = 30.0  # [m] longer ranges become this one
    no_return: float = 0.0  # [m] range of a beam without return
    pedestrians: bool = True  # show the pedestrians to the network
    lookahead: float = 2.0  # [m] of the sub-goal
    goal_margin: float = 0.9  # [m] the robot stops this near the goal
    stop_range: float = 0.4  # [m] at shorter ranges ahead it turns in place
    stop_turn: float = 0.7  # [rad/s] this fast
    v_max: float = 0.5  # [m/s] of the greatest answer
    omega_max: float = 2.0  # [rad/s] of the greatest answer
    v_free: float | None = None  # [m/s] v_max where it is free ahead; None: the same
    free_range: float = 2.2  # [m] free ahead: no shorter range

    def __post_init__(self) -> None:
        for key in ("sweep_rate", "fov", "range_max", "lookahead", "v_max", "omega_max", "free_range"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in ("goal_margin", "stop_range", "stop_turn"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        require("planner.fov", self.fov, at_most=math.tau)
        require("planner.no_return", self.no_return, at_least=0.0, at_most=self.range_max)
        if self.v_free is not None:
            require("planner.v_free", self.v_free, above=0.0)
        if self.batch_norm not in BATCH_NORMS:
            raise InputError(
                f"planner.batch_norm is {self.batch_norm!r}: must be one of {', '.join(BATCH_NORMS)}"
            )


class DrlVo:
    """DRL-VO (Xie & Dames 2023, T-RO, DOI 10.1109/TRO.2023.3257549).

    Network, observation, action and rules are those of the authors' code, github.com/TempleRAIL/drl_vo_nav and
    nav-competition-icra2022-drl-vo. The sub-goal is where the guide's path leaves the disc of `lookahead` about the
    robot, or its end; without a path, the guide's subgoal, at most so far away. While the guide finds no path, it
    stays what it was, in the robot frame. Near the goal the robot stops, near an obstacle ahead it turns left in
    place. The command is limited to what the robot can reach in a period.
    """

    Config = DrlVoConfig

    def __init__(self, config: DrlVoConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._network = Network(_weights(config.weights), config.batch_norm)
        rates = (robot.control_rate, config.sweep_rate)
        self._sweeps = Sweeps(config.fov, config.range_max, config.no_return, rates)
        _warn_if_untrained(config, robot)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the sweeps and the sub-goal; take the random numbers that actions are drawn with."""
        self._rng = rng
        self._sweeps.clear()
        self._goal: Floats = _NOWHERE

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Command for one control period. A range that is NaN is no return."""
        mount_yaw = self._robot.lidar.yaw
        self._sweeps.add(observation.scan, mount_yaw)
        self._goal = self._sub_goal(guidance)
        ahead = free_ahead(observation.scan, mount_yaw)
        arrived = math.hypot(*self._goal) <= self._config.goal_margin
        if guidance.path is None:  # then the sub-goal is no end of a path, and may be near anywhere
            arrived = arrived and math.hypot(*observation.target) <= self._config.goal_margin
        v, omega = (0.0, 0.0) if arrived else self._command(observation, ahead)
        return limited(v, omega, observation, self._robot.dt)

    def _command(self, observation: Observation, ahead: float) -> tuple[float, float]:
        """The network's answer as a command, or the turn before an obstacle. ahead: least range ahead [m]."""
        config = self._config
        if ahead <= config.stop_range:
            return 0.0, config.stop_turn
        first, second = self._action(observation)
        fast = config.v_free is not None and ahead >= config.free_range
        v_max = config.v_free if fast and config.v_free is not None else config.v_max
        return (first + 1.0) / 2.0 * v_max, second * config.omega_max

    def _action(self, observation: Observation) -> Floats:
        """The network's answer: (2,) in [−1, 1]."""
        config = self._config
        people = observation.pedestrians if config.pedestrians else _NOBODY
        image = image_of(self._sweeps, velocity_maps(people))
        action = self._network.means(image, self._goal / config.lookahead)
        if not config.deterministic:
            action = action + self._network.deviations * self._rng.standard_normal(2)
        clipped: Floats = np.clip(action, -1.0, 1.0)
        return clipped

    def _sub_goal(self, guidance: Guidance) -> Floats:
        """The point that the network is led to, in the robot frame: (2,) [m]."""
        path = guidance.path
        if path is None:
            path = np.vstack([_NOWHERE, guidance.subgoal])
        elif guidance.blocked:
            return self._goal
        x, y, _ = leaves(np.ascontiguousarray(path, dtype=np.float64), self._config.lookahead)
        return np.array([x, y])


def _weights(path: str | None) -> Arrays:
    if path is None:
        raise InputError(
            "planner.weights is null: no DRL-VO network ships with lme; import the authors' archive with "
            "`lme weights import drl_vo PATH NAME`, then give planner.weights=NAME"
        )
    return read_weights(Path(path))


def _warn_if_untrained(config: DrlVoConfig, robot: Robot) -> None:
    for key, trained in _TRAINED.items():
        commanded, reached = getattr(config, key), getattr(robot, key)
        said = f"the published DRL-VO network was trained for commands of up to {trained:g}"
        if commanded > trained:
            warnings.warn(f"planner.{key} is {commanded:g}: {said}", stacklevel=3)
        if reached < commanded:
            warnings.warn(f"robot.{key} is {reached:g}, less than planner.{key}: {said}", stacklevel=3)
