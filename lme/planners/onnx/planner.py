"""Policy that was trained elsewhere, such as in `lme.gym`, and saved as an ONNX file."""

from __future__ import annotations

import numpy as np

from lme.errors import argument_error
from lme.inputs.guarded_file import expanded
from lme.planners.commands import limited
from lme.planners.onnx.config import OnnxConfig
from lme.planners.onnx.features import OnnxFeatures
from lme.planners.onnx.network import Network
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation, Twist


class OnnxPolicy:
    """Follows the policy in an ONNX file (docs/envs.md).

    The policy maps the parts of the observation that the config names to two numbers, for v and ω. Its target is the
    guide's subgoal. The command is limited to what the robot can reach in a period.
    """

    Config = OnnxConfig

    def __init__(self, config: OnnxConfig, robot: Robot) -> None:
        if config.path is None:
            raise argument_error("path is null: must be the path of an .onnx file (docs/envs.md)")
        self._config, self._robot = config, robot
        self._features = OnnxFeatures(config, robot)
        self._network = Network(expanded(config.path), self._features.sizes)
        self._last: Floats = np.zeros(2)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last outputs; `rng` is not used."""
        self._last = np.zeros(2)

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period. Raises InputError for outputs that are not finite."""
        answer = self._network.answer(self._features.of(observation, guidance.subgoal, self._last))
        if not np.isfinite(answer).all():
            raise argument_error(
                f"path is {self._config.path}: the network answers {answer.tolist()}; must be finite numbers"
            )
        self._last = np.clip(answer, -1.0, 1.0) if self._config.action.clip else answer
        v, omega = self._velocities(observation.limits)
        return limited(v, omega, observation, self._robot.dt)

    def _velocities(self, limits: Limits) -> tuple[float, float]:
        """Velocities for the last outputs [m/s, rad/s]."""
        action, (v, omega) = self._config.action, self._last.tolist()
        return (
            _between(v, action.v or [-limits.v_max, limits.v_max]),
            _between(omega, action.omega or [-limits.omega_max, limits.omega_max]),
        )


def _between(output: float, ends: list[float]) -> float:
    """Map an output to the range in which −1 and 1 are the ends; for symmetric ends, their product with it."""
    middle, half = (ends[0] + ends[1]) / 2.0, (ends[1] - ends[0]) / 2.0
    return middle + output * half
