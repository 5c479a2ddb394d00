"""Model predictive path integral control (MPPI), as in Nav2's default controller."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import to_world
from lme.mapping.costmap import LocalCostmap
from lme.planners.commands import limited
from lme.planners.mppi.config import MppiConfig
from lme.planners.mppi.critics import Critics
from lme.planners.mppi.kernels.rollout import (
    Singles,
    VelocityLimits,
    average,
    charge_controls,
    constrain,
    rollout,
    smooth,
)
from lme.planners.polyline import stretch
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation, Twist

_REMEMBERED = 4  # commands before the present one, for the filter


def draw(rng: np.random.Generator, samples: int, steps: int) -> Singles:
    """Standard normal noise (samples, steps, 2) of velocities and turn rates."""
    return rng.standard_normal((samples, steps, 2), dtype=np.float32)


class Mppi:
    """MPPI (Williams et al. 2017, DOI 10.1109/ICRA.2017.7989202) as in nav2_mppi_controller of ROS 2 Jazzy.

    Noise around the last sequence of controls gives a batch of trajectories. Critics score them on a local costmap, and
    the weighted mean of their controls is the next sequence. If all of them touch obstacles, the sequence begins anew
    from rest, `retry_attempt_limit` times, and then the robot stops. If the control period of the robot is
    longer than a step of the model, a command is the mean of the controls within it.
    """

    Config = MppiConfig

    def __init__(self, config: MppiConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._hold = math.floor(robot.dt / config.model_dt + 1e-6)  # [steps] of the model for one command
        self._hold = min(self._hold, config.time_steps - 1)
        self.costmap = LocalCostmap(config.costmap, robot)
        self._critics = Critics(config, self.costmap, robot)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget map and controls."""
        self._rng = rng
        self.costmap.reset(rng)
        self._forget()

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        self.costmap.update(observation)
        if math.hypot(*observation.target) < self._config.xy_goal_tolerance:
            self._forget()
            return limited(0.0, 0.0, observation, self._dt)
        path = self._path(observation, guidance)
        limits = self._limits(observation.limits)
        for _ in range(self._config.retry_attempt_limit + 1):
            if self._optimize(observation, path, limits):
                return limited(*self._command(limits), observation, self._dt)
            self._forget()
        return limited(0.0, 0.0, observation, self._dt)

    def _forget(self) -> None:
        """Start again from rest."""
        self.sequence = np.zeros((self._config.time_steps, 2))  # of controls [m/s, rad/s]
        self._sent_controls = np.zeros((_REMEMBERED, 2))

    def _path(self, observation: Observation, guidance: Guidance) -> Floats:
        """Return the first `prune_distance` of the path from the robot, in the odometry frame: (P, 2), P ≥ 2."""
        config, line = self._config, guidance.path
        if line is None or len(line) == 0:
            line = np.vstack([np.zeros(2), guidance.subgoal])
        ahead = stretch(line, 0.0, config.prune_distance, config.path_spacing)
        ahead = ahead if len(ahead) else line[-1:]
        return to_world(np.vstack([line[:1], ahead]), observation.odometry)

    def _limits(self, robot: Limits) -> VelocityLimits:
        """Return the configured limits within those of the robot."""
        config = self._config
        return (
            max(config.vx_min, robot.lowest),
            min(config.vx_max, robot.v_max),
            min(config.wz_max, robot.omega_max),
            max(config.ax_min, -robot.alpha_v),
            min(config.ax_max, robot.alpha_v),
            min(config.az_max, robot.alpha_omega),
        )

    def _optimize(self, observation: Observation, path: Floats, limits: VelocityLimits) -> bool:
        """Improve the sequence; return whether some trajectory is free."""
        config, stds = self._config, (self._config.vx_std, self._config.wz_std)
        for _ in range(config.iteration_count):
            noise = draw(self._rng, config.batch_size, config.time_steps)
            controls, speeds, poses = rollout(
                self.sequence,
                noise,
                stds,
                observation.ramp_start,
                observation.odometry,
                limits,
                config.model_dt,
            )
            costs, free = self._critics.score(observation, path, speeds, poses, limits[:2])
            charge_controls(costs, self.sequence, controls, stds, config.gamma)
            self.sequence = average(controls, costs, config.temperature)
            constrain(self.sequence, limits, config.model_dt)
        return free

    def _command(self, limits: VelocityLimits) -> tuple[float, float]:
        """Return the mean of the filtered controls until the next command, and advance the sequence to it."""
        sequence, hold = smooth(self.sequence, self._sent_controls), self._hold
        controls = sequence[1 : hold + 1] if hold else sequence[:1]  # element 0 is the present control
        self._sent_controls = np.vstack([self._sent_controls, controls])[-_REMEMBERED:]
        self.sequence = np.vstack([sequence[hold:], np.repeat(sequence[-1:], hold, axis=0)])
        v, omega = controls.mean(axis=0).tolist()
        return min(max(v, limits[0]), limits[1]), min(max(omega, -limits[2]), limits[2])
