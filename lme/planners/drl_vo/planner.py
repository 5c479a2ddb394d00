"""DRL-VO: a reinforcement-learned local planner that sees past scans and pedestrians and follows a global path."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from lme.errors import argument_error, config_key
from lme.inputs.onnx_file import SignedNetwork
from lme.planners.commands import limited
from lme.planners.drl_vo.config import DrlVoConfig
from lme.planners.drl_vo.graph import REPORTED, SIGNATURE
from lme.planners.drl_vo.interface import DrlVoFeatures, DrlVoInterface
from lme.planners.drl_vo.observation import image_of
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

_NO_ANSWER = np.zeros(2)


class DrlVo:
    """DRL-VO (Xie & Dames 2023, T-RO, DOI 10.1109/TRO.2023.3257549).

    Network, observation, action and rules are those of the authors' code, github.com/TempleRAIL/drl_vo_nav and
    nav-competition-icra2022-drl-vo. The sub-goal is where the guide's path leaves the disc of `lookahead` about the
    robot, or its end; without a path, the guide's subgoal, at most that far away. While the guide finds no path, the
    sub-goal stays the same in the robot frame. Near the goal the robot stops, near an obstacle ahead it turns left in
    place. The command is limited to what the robot can reach in a period. A NaN range is not a return.
    """

    Config = DrlVoConfig

    def __init__(self, config: DrlVoConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._network = SignedNetwork(_path(config.weights), SIGNATURE)
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


def _path(path: str | None) -> Path:
    if path is None:
        raise argument_error(
            "weights is null: the authors' network does not ship with lme; import their archive with "
            "`lme weights import drl_vo PATH NAME`, then set weights=NAME; or use planner=drl_vo_small"
        )
    return Path(path)


def _warn_if_untrained(config: DrlVoConfig, robot: Robot, trained: Floats) -> None:
    for key, limit in zip(REPORTED, trained.tolist(), strict=True):
        commanded, reached = getattr(config, key), getattr(robot, key)
        said = f"this DRL-VO network was trained for commands of up to {limit:.3g}"
        if commanded > limit * (1.0 + 1e-6):  # float32
            warnings.warn(f"{config_key(key)} is {commanded:g}: {said}", stacklevel=3)
        if reached < commanded:
            warnings.warn(f"robot.{key} is {reached:g}, less than {config_key(key)}: {said}", stacklevel=3)
