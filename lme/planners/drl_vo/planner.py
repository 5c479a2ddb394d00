"""DRL-VO: a reinforcement-learned local planner that sees past scans and pedestrians and follows a global path."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lme.errors import argument_error, config_key, require
from lme.geometry.polyline import exit_point
from lme.inputs.onnx_file import SignedNetwork
from lme.planners.commands import limited
from lme.planners.drl_vo.observation import Outlines, Sweeps, free_ahead, image_of
from lme.planners.drl_vo.weights import REPORTED, SIGNATURE
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

PEDESTRIANS = 32  # that the network sees at most: the nearest
_NO_ANSWER = np.zeros(2)
_NOWHERE = np.zeros(2)


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
    trained_outline: list[float] | None

    def __post_init__(self) -> None:
        for key in ("sweep_rate", "fov", "range_max", "lookahead", "v_max", "omega_max", "free_range"):
            require(key, getattr(self, key), above=0.0)
        for key in ("goal_margin", "stop_range", "stop_turn"):
            require(key, getattr(self, key), at_least=0.0)
        require("fov", self.fov, at_most=math.tau)
        require("no_return", self.no_return, at_least=0.0, at_most=self.range_max)
        if self.v_free is not None:
            require("v_free", self.v_free, above=0.0)
        if self.trained_outline is not None:
            if len(self.trained_outline) != 2:
                raise argument_error(
                    f"trained_outline is {list(self.trained_outline)}: must be two distances, straight ahead and aside"
                )
            for distance in self.trained_outline:
                require("trained_outline", distance, at_least=0.0)


class DrlVo:
    """DRL-VO (Xie & Dames 2023, T-RO, DOI 10.1109/TRO.2023.3257549).

    Network, observation, action and rules are those of the authors' code, github.com/TempleRAIL/drl_vo_nav and
    nav-competition-icra2022-drl-vo. The sub-goal is where the guide's path leaves the disc of `lookahead` about the
    robot, or its end; without a path, the guide's subgoal, at most that far away. While the guide finds no path, the
    sub-goal stays the same in the robot frame. Near the goal the robot stops, near an obstacle ahead it turns left in
    place. The command is limited to what the robot can reach in a period. A NaN range is not a return. With
    `trained_outline`, the network sees each obstacle as far from the robot of its training as it is from this one.
    """

    Config = DrlVoConfig

    def __init__(self, config: DrlVoConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        if config.weights is None:
            raise argument_error(
                "weights is null: the authors' network does not ship with lme; import their archive with "
                "`lme weights import drl_vo PATH NAME`, then set weights=NAME; or use planner=drl_vo_small"
            )
        self._network = SignedNetwork(Path(config.weights), SIGNATURE)
        self.interface = DrlVoInterface(config, robot)
        self.seen: DrlVoFeatures | None = None  # inputs of the network at the last step
        _warn_if_untrained(config, robot, self._network.trained)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the sweeps and the sub-goal; `rng` draws the actions."""
        self._rng = rng
        self.interface.clear()

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        interface = self.interface
        self.seen = interface.features(observation, interface.goal(guidance))
        if interface.arrived(observation, guidance):
            return limited(0.0, 0.0, observation, self._robot.dt)
        answer = _NO_ANSWER if interface.turns(observation) else self._output(self.seen)
        return interface.command(answer, observation)

    def _output(self, features: DrlVoFeatures) -> Floats:
        """Return the network's output: (2,) in [−1, 1]."""
        image = image_of(features.sweeps, features.pedestrians)
        answer, deviations = self._network.answer(image, features.goal)
        if not self._config.deterministic:
            answer = answer + deviations * self._rng.standard_normal(2)
        clipped: Floats = np.clip(answer, -1.0, 1.0)
        return clipped


def _warn_if_untrained(config: DrlVoConfig, robot: Robot, trained: Floats) -> None:
    for key, limit in zip(REPORTED, trained.tolist(), strict=True):
        commanded, reached = getattr(config, key), getattr(robot, key)
        said = f"this DRL-VO network was trained for commands of up to {limit:.3g}"
        if commanded > limit * (1.0 + 1e-6):  # float32
            warnings.warn(f"{config_key(key)} is {commanded:g}: {said}", stacklevel=3)
        if reached < commanded:
            warnings.warn(f"robot.{key} is {reached:g}, less than {config_key(key)}: {said}", stacklevel=3)


class DrlVoFeatures(NamedTuple):
    """Inputs of the network, of which `observation.image_of` makes an image.

    sweeps: (20, 80) in [−1, 1], least and mean range of each of the ten sweeps, the oldest first. pedestrians:
    (32, 4), as in an observation, after rows of zeros. goal: (2,) in look-ahead distances.
    """

    sweeps: Floats
    pedestrians: Floats
    goal: Floats


class DrlVoInterface:
    """Inputs of the network from the last half second, and the command for its output."""

    def __init__(self, config: DrlVoConfig, robot: Robot) -> None:
        self._config = config
        self._dt, self._mount_yaw = robot.dt, robot.lidar.yaw
        rates, outlines = (robot.control_rate, config.sweep_rate), None
        if config.trained_outline is not None:
            ahead, aside = config.trained_outline
            outlines = Outlines(robot.footprint.box, robot.lidar.mount, ahead, aside, config.fov)
        self._sweeps = Sweeps(config.fov, config.range_max, config.no_return, rates, outlines)
        self._goal: Floats = _NOWHERE

    def clear(self) -> None:
        """Forget the sweeps and the sub-goal."""
        self._sweeps.clear()
        self._goal = _NOWHERE

    def features(self, observation: Observation, subgoal: Floats) -> DrlVoFeatures:
        """Add the scan and return the inputs; call once per step. subgoal: (2,) in the robot frame [m]."""
        self._sweeps.add(observation.scan, self._mount_yaw)
        pedestrians = np.zeros((PEDESTRIANS, 4))
        if self._config.pedestrians:
            nearest = np.argsort(np.hypot(*observation.pedestrians[:, :2].T), kind="stable")[:PEDESTRIANS]
            # in the order of the tracker: of two in a cell the last one counts
            pedestrians[PEDESTRIANS - len(nearest) :] = observation.pedestrians[np.sort(nearest)]
        return DrlVoFeatures(self._sweeps.rows(), pedestrians, subgoal / self._config.lookahead)

    def goal(self, guidance: Guidance) -> Floats:
        """Return the sub-goal of the network, in the robot frame: (2,) [m]."""
        path = guidance.path
        if path is None:
            path = np.vstack([_NOWHERE, guidance.subgoal])
        elif guidance.blocked:
            return self._goal
        x, y, _ = exit_point(np.ascontiguousarray(path, dtype=np.float64), self._config.lookahead)
        self._goal = np.array([x, y])
        return self._goal

    def action(self, command: Twist, observation: Observation) -> Floats:
        """Return the output (2,) that corresponds to a command, clipped to ±1; reverse becomes 0."""
        first = 2.0 * command.v / self._fastest(observation) - 1.0
        answer: Floats = np.clip([first, command.omega / self._config.omega_max], -1.0, 1.0)
        return answer

    def command(self, action: Floats, observation: Observation) -> Twist:
        """Return the command for an output (2,) in [−1, 1], or the turn in front of an obstacle.

        It is limited to what the robot can reach in a period.
        """
        config = self._config
        if self.turns(observation):
            return limited(0.0, config.stop_turn, observation, self._dt)
        v = (float(action[0]) + 1.0) / 2.0 * self._fastest(observation)
        return limited(v, float(action[1]) * config.omega_max, observation, self._dt)

    def turns(self, observation: Observation) -> bool:
        """Return whether an obstacle ahead is so near that the robot turns left in place regardless of the output."""
        return free_ahead(observation.scan, self._mount_yaw) <= self._config.stop_range

    def arrived(self, observation: Observation, guidance: Guidance) -> bool:
        """Return whether the sub-goal is so near that the robot stops."""
        margin = self._config.goal_margin
        near = math.hypot(*self._goal) <= margin
        # without a path the sub-goal is not the end of one, and may be near anywhere
        return near and (guidance.path is not None or math.hypot(*observation.target) <= margin)

    def _fastest(self, observation: Observation) -> float:
        """Speed for the greatest output [m/s]."""
        config = self._config
        if config.v_free is None or free_ahead(observation.scan, self._mount_yaw) < config.free_range:
            return config.v_max
        return config.v_free
