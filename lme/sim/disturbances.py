"""What comes between a robot and its idea of the world: delay, slip, noise, lost beams, a goal in the mist."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.errors import require
from lme.geometry.frames import to_robot, to_world
from lme.types import Floats, Pose, Twist

Ranges = NDArray[np.float32]


@dataclass(slots=True, kw_only=True)
class Disturbances:
    """Keys of every simulator; the defaults disturb nothing."""

    latency: float = 0.0  # [s] from a command to its effect
    slip: float = 0.0  # [-] standard deviation of what each wheel gains or loses, drawn per control period
    scan_noise: float = 0.0  # [m] standard deviation, on top of robot.lidar.noise_std
    scan_dropout: float = 0.0  # [-] share of beams that return nothing
    goal_noise: float = 0.0  # [m] standard deviation in x and in y of where the robot believes to be
    goal_noise_yaw: float = 0.0  # [rad] standard deviation of its believed heading
    goal_rate: float | None = None  # [Hz] at which the target is found anew; None: with every scan

    def __post_init__(self) -> None:
        for key in ("latency", "slip", "scan_noise", "goal_noise", "goal_noise_yaw"):
            require(f"sim.{key}", getattr(self, key), at_least=0.0)
        require("sim.scan_dropout", self.scan_dropout, at_least=0.0, at_most=1.0)
        if self.goal_rate is not None:
            require("sim.goal_rate", self.goal_rate, above=0.0)


class Delay:
    """Commands on their way to the wheels. Before the first one arrives, the robot is told to stand."""

    def __init__(self, latency: float) -> None:
        self._latency = latency
        self._under_way: deque[tuple[float, Twist]] = deque()
        self._now = Twist(0.0, 0.0)

    def send(self, command: Twist, time: float) -> None:
        """A command given at `time` [s]."""
        self._under_way.append((time + self._latency, command))

    def at(self, time: float) -> Twist:
        """The last command that has arrived by `time` [s]; times do not go back."""
        while self._under_way and self._under_way[0][0] <= time:
            _, self._now = self._under_way.popleft()
        return self._now


class Target:
    """Where the robot believes its goal to be.

    A fix is the goal seen from the pose that localisation (AMCL, a UWB tag) reports: the true one with an
    error of its own in x, y and yaw, drawn per fix. Between fixes odometry carries the target along.
    """

    def __init__(self, config: Disturbances, goal: Floats, rng: np.random.Generator) -> None:
        self._deviation = (config.goal_noise, config.goal_noise, config.goal_noise_yaw)
        self._rate = config.goal_rate
        self._exact = config.goal_rate is None and not any(self._deviation)
        self._goal = goal
        self._rng = rng
        self._due = 0.0
        self._fix = goal

    def seen_from(self, pose: Pose, odometry: Pose, time: float) -> Floats:
        """(2,) target in the robot frame [m]. pose: the truth; odometry: the robot's own."""
        if self._exact:
            return to_robot(self._goal, pose)
        if self._rate is None or time >= self._due - 1e-9:
            self._fix = to_world(to_robot(self._goal, self._believed(pose)), odometry)
            self._due = (
                math.inf if self._rate is None else (math.floor(time * self._rate + 1e-9) + 1) / self._rate
            )
        return to_robot(self._fix, odometry)

    def _believed(self, pose: Pose) -> Pose:
        """The pose that localisation reports."""
        return Pose(*(np.asarray(pose) + self._rng.normal(0.0, self._deviation)).tolist())


def slip_factors(slip: float, rng: np.random.Generator) -> tuple[float, float]:
    """Ground covered per metre of tread, left and right wheel, for one control period."""
    if slip == 0.0:
        return 1.0, 1.0
    left, right = 1.0 + slip * rng.standard_normal(2)
    return float(left), float(right)


def slipped(motion: tuple[float, float], factors: tuple[float, float], track: float) -> tuple[float, float]:
    """Distance [m] and turn [rad] (or their rates) over ground, from those of the wheels `track` [m] apart."""
    forward, turn = motion
    left = (forward - turn * track / 2) * factors[0]
    right = (forward + turn * track / 2) * factors[1]
    return (left + right) / 2, (right - left) / track


def lose_beams(ranges: Ranges, share: float, range_max: float, rng: np.random.Generator) -> None:
    """Let this share of the beams return nothing, in place: they read range_max."""
    ranges[rng.random(len(ranges), dtype=np.float32) < share] = range_max


@njit(cache=True)
def add_noise(ranges: Ranges, noise: Ranges, std: float, range_max: float) -> None:
    """Gaussian noise on every return, in place; beams that hit nothing stay at range_max."""
    for i in range(len(ranges)):
        if ranges[i] < np.float32(range_max):
            ranges[i] = min(max(ranges[i] + std * noise[i], 0.0), range_max)
