"""Interface between a robot and the DRL-VO network: its inputs, and the command for its output."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lme.planners.commands import limited
from lme.planners.drl_vo.config import DrlVoConfig
from lme.planners.drl_vo.observation import Sweeps, free_ahead
from lme.planners.polyline import exit_point
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

PEDESTRIANS = 32  # that the network sees at most: the nearest
_NOWHERE = np.zeros(2)


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
        rates = (robot.control_rate, config.sweep_rate)
        self._sweeps = Sweeps(config.fov, config.range_max, config.no_return, rates)
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
