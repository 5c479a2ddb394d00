"""Kinematic simulator: exact geometry, no dynamics beyond velocity and acceleration limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.frames import compose, relative, to_robot
from lme.kernels.collision import sweep
from lme.kernels.motion import drive, first_within
from lme.kernels.raycast import cast
from lme.robots import Robot, require
from lme.sim.simulator import State
from lme.types import Floats, LaserScan, Limits, Observation, Pose, Twist
from lme.worlds.world import Task

Ranges = NDArray[np.float32]


@dataclass(slots=True)
class FastConfig:
    """How finely motion is checked for contact, and how velocity follows the command."""

    max_step: float = 0.025  # [m] no point of the footprint moves further between two checks
    even_ramp: bool = False  # spread a change of velocity over the control period instead of α, then hold

    def __post_init__(self) -> None:
        require("sim.max_step", self.max_step, above=0.0)


class FastSimulator:
    """Differential drive among static obstacles, a footprint that may not touch, a noisy lidar."""

    Config = FastConfig

    def __init__(self, config: FastConfig, robot: Robot) -> None:
        self._robot = robot
        self._config = config
        lidar = robot.lidar
        self._angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, at rest."""
        self._circles = np.ascontiguousarray(task.world.circles, dtype=np.float64)
        self._edges = task.world.edges
        self._goal = np.asarray(task.goal, dtype=np.float64)
        self._goal_tolerance = task.goal_tolerance
        self._rng = rng
        self._start = Pose(*map(float, task.start))
        self.state = self._settle(np.array([self._start]), Twist(0.0, 0.0), 0.0, 0.0)
        return self._observe()

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact or arrival, whichever comes first."""
        robot, state = self._robot, self.state
        limits = self._even_limits(command) if self._config.even_ramp else robot.limits
        travel, twist = drive(
            state.pose, state.twist, command, limits, robot.dt, self._config.max_step, robot.footprint.r_max
        )
        self.state = self._settle(travel, Twist(*twist), state.time, robot.dt)
        return self._observe()

    def _even_limits(self, command: Twist) -> Limits:
        """Limits under which the change of velocity takes the whole period, where α allows."""
        limits, twist, dt = self._robot.limits, self.state.twist, self._robot.dt
        v = min(max(command.v, -limits.v_max), limits.v_max)
        omega = min(max(command.omega, -limits.omega_max), limits.omega_max)
        alpha_v = min(limits.alpha_v, max(abs(v - twist.v) / dt, 1e-9))
        alpha_omega = min(limits.alpha_omega, max(abs(omega - twist.omega) / dt, 1e-9))
        return limits._replace(alpha_v=alpha_v, alpha_omega=alpha_omega)

    def _settle(self, travel: Floats, twist: Twist, start_time: float, dt: float) -> State:
        """Cut the motion at contact or arrival; touching on arrival is contact."""
        steps = len(travel)
        arrival = first_within(travel, self._goal, self._goal_tolerance)
        if arrival >= 0:
            travel = travel[: arrival + 1]
        clearance, contact = sweep(travel, self._robot.footprint.box, self._circles, self._edges)
        if contact >= 0:
            travel = travel[: contact + 1]
        pose = Pose(*travel[-1].tolist())
        time = start_time + dt * len(travel) / steps
        return State(pose, twist, time, travel, clearance, contact >= 0, arrival >= 0 and contact < 0)

    def _observe(self) -> Observation:
        lidar, state = self._robot.lidar, self.state
        pose = compose(state.pose, lidar.mount)
        ranges = cast(pose, self._angles, lidar.range_max, self._circles, self._edges)
        if lidar.noise_std > 0.0:
            noise = self._rng.standard_normal(lidar.num_beams, dtype=np.float32)
            _add_noise(ranges, noise, lidar.noise_std, lidar.range_max)
        scan = LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)
        target, odometry = to_robot(self._goal, state.pose), relative(state.pose, self._start)
        return Observation(scan, target, state.twist, self._robot.limits, odometry)


@njit(cache=True)
def _add_noise(ranges: Ranges, noise: Ranges, std: float, range_max: float) -> None:
    """Gaussian noise on every return, in place; beams that hit nothing stay at range_max."""
    for i in range(len(ranges)):
        if ranges[i] < np.float32(range_max):
            ranges[i] = min(max(ranges[i] + std * noise[i], 0.0), range_max)
