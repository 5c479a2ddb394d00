"""Disturbances: latency, lag, gait, wheel slip, errors of odometry, scan and localisation, lost beams."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import require
from lme.geometry.frames import between, compose, relative, to_robot, to_world
from lme.types import Floats, Pose, Twist

Ranges = NDArray[np.float32]
_MOST = {"overshoot_v": 0.95, "overshoot_omega": 0.95, "scan_dropout": 1.0}


@dataclass(slots=True, kw_only=True)
class Disturbances:
    """Settings of the disturbances, the same in every simulator. By default there are none."""

    latency: float
    odometry_age: float
    lag: float
    natural_frequency_v: float
    natural_frequency_omega: float
    overshoot_v: float
    overshoot_omega: float
    ripple_v: float
    ripple_omega: float
    tilt: float
    slip: float
    odometry_error: float
    scan_noise: float
    scan_dropout: float
    goal_noise: float
    goal_noise_yaw: float
    goal_rate: float | None

    def __post_init__(self) -> None:
        for field in fields(Disturbances):
            value = getattr(self, field.name)
            if value is not None:  # only goal_rate may be None
                require(field.name, value, at_least=0.0, at_most=_MOST.get(field.name))

    @property
    def has_gait(self) -> bool:
        """Return whether legs follow the command, in v or in ω."""
        return self.natural_frequency_v > 0.0 or self.natural_frequency_omega > 0.0

    @property
    def disturbs_sensors(self) -> bool:
        """Return whether scan, odometry or localisation are disturbed."""
        motion = self.odometry_age, self.ripple_v, self.ripple_omega, self.odometry_error
        scan = self.tilt, self.scan_noise, self.scan_dropout
        return any((*motion, *scan, self.goal_noise, self.goal_noise_yaw)) or self.goal_rate is not None


class Delay:
    """Queue of commands on their way to the wheels. Before the first one arrives, the command is zero."""

    def __init__(self, latency: float) -> None:
        self._latency = latency
        self._pending: deque[tuple[float, Twist]] = deque()
        self._arrived = Twist(0.0, 0.0)

    def send(self, command: Twist, time: float) -> None:
        """Queue a command given at `time` [s]."""
        self._pending.append((time + self._latency, command))

    def at(self, time: float) -> Twist:
        """Return the last command that has arrived by `time` [s], which must not decrease from call to call."""
        while self._pending and self._pending[0][0] <= time:
            _, self._arrived = self._pending.popleft()
        return self._arrived


class Measured(NamedTuple):
    """True pose, and twist and odometry as the robot measures them, at one time."""

    pose: Pose
    twist: Twist
    odometry: Pose


class PastMotion:
    """Motion some time ago, interpolated between observations; before the first observation, the first."""

    def __init__(self, age: float) -> None:
        """age: of the motion that is returned [s]; 0: the current motion."""
        self._age = age
        self._motions: deque[tuple[float, Measured]] = deque()

    def at(self, time: float, motion: Measured) -> Measured:
        """Return the motion at `time` − age [s]. motion: at `time`, which must not decrease from call to call."""
        if self._age == 0.0:
            return motion
        self._motions.append((time, motion))
        while len(self._motions) > 1 and self._motions[1][0] <= time - self._age:
            self._motions.popleft()
        (start, a), (end, b) = self._motions[0], self._motions[min(1, len(self._motions) - 1)]
        fraction = max(time - self._age - start, 0.0) / (end - start) if end > start else 0.0
        v, omega = (x + fraction * (y - x) for x, y in zip(a.twist, b.twist, strict=True))
        return Measured(
            between(a.pose, b.pose, fraction), Twist(v, omega), between(a.odometry, b.odometry, fraction)
        )


class Odometry:
    """Motion as the robot measures it itself: speed and turn rate are wrong by constant factors.

    This happens if the wheels' diameter and distance, or the gyro's scale, differ from what the robot assumes. Such
    errors are systematic (Borenstein & Feng 1996, doi:10.1109/70.544770): they grow with the path driven instead of
    averaging out.
    """

    def __init__(self, error: float, rng: np.random.Generator) -> None:
        """error: standard deviation of both factors' difference from 1; 0: the measurement is exact."""
        self._exact = error == 0.0
        self._scale_v, self._scale_omega = (1.0 + error * rng.standard_normal(2)).tolist()
        self._last_odometry = self._pose = Pose(0.0, 0.0, 0.0)

    def measured(self, twist: Twist, odometry: Pose) -> tuple[Twist, Pose]:
        """Return twist and pose since the start as measured, from those of exact encoders. Call once per period."""
        if self._exact:
            return twist, odometry
        step, self._last_odometry = relative(odometry, self._last_odometry), odometry
        turn = self._scale_omega * step.yaw
        x, y = (self._scale_v * to_world(np.array(step[:2]), Pose(0.0, 0.0, (turn - step.yaw) / 2))).tolist()
        self._pose = compose(self._pose, Pose(x, y, turn))
        return Twist(self._scale_v * twist.v, self._scale_omega * twist.omega), self._pose


class TargetEstimate:
    """The robot's estimate of its target, from localisation and odometry.

    A fix is the goal as seen from the pose that localisation (AMCL, a UWB tag) reports: the true pose with an
    error in x, y and yaw, drawn for each fix. Between fixes the target is updated by odometry.
    """

    def __init__(self, config: Disturbances, goal: Floats, rng: np.random.Generator) -> None:
        self._deviation = (config.goal_noise, config.goal_noise, config.goal_noise_yaw)
        self._rate = config.goal_rate
        self._exact = config.goal_rate is None and not any(self._deviation)
        self._goal = goal
        self._rng = rng
        self._due = 0.0
        self._fix = goal

    def aim(self, goal: Floats) -> None:
        """Use another goal (2,) [m] from the next fix on, which is due at once if the goal has moved."""
        if not np.array_equal(goal, self._goal):
            self._goal, self._due = goal, 0.0

    def seen_from(self, pose: Pose, odometry: Pose, time: float) -> Floats:
        """Return the target in the robot frame (2,) [m]. pose: the true one; odometry: pose by the wheel encoders."""
        if self._exact:
            return to_robot(self._goal, pose)
        if self._rate is None or time >= self._due - 1e-9:
            # See the goal from the pose that localisation reports.
            estimate = Pose(*(np.asarray(pose) + self._rng.normal(0.0, self._deviation)).tolist())
            self._fix = to_world(to_robot(self._goal, estimate), odometry)
            self._due = (math.floor(time * self._rate + 1e-9) + 1) / self._rate if self._rate else math.inf
        return to_robot(self._fix, odometry)


def slip_factors(slip: float, rng: np.random.Generator) -> tuple[float, float]:
    """Ground covered per metre of tread, left and right wheel, for one control period."""
    if slip == 0.0:
        return 1.0, 1.0
    left, right = 1.0 + slip * rng.standard_normal(2)
    return float(left), float(right)


def slipped(motion: tuple[float, float], factors: tuple[float, float], track: float) -> tuple[float, float]:
    """Distance [m] and turn [rad] over ground, or their rates, from those of wheels `track` [m] apart."""
    forward, turn = motion
    left = (forward - turn * track / 2) * factors[0]
    right = (forward + turn * track / 2) * factors[1]
    return (left + right) / 2, (right - left) / track


def lose_beams(ranges: Ranges, fraction: float, range_max: float, rng: np.random.Generator) -> None:
    """Set a random fraction of the beams to range_max, in place, as if they had no return."""
    ranges[rng.random(len(ranges), dtype=np.float32) < fraction] = range_max
