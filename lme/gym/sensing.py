"""Lidars, encoders and localisation of many robots with disturbances, each as `lme.simulation.simulator.Sensors`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.gym.kernels.measuring import Estimates, measure
from lme.gym.kernels.rolling import Encoders
from lme.gym.kernels.steps import States
from lme.perception.raycast import add_noise
from lme.robots import Robot
from lme.simulation.disturbances import Disturbances, lose_beams
from lme.simulation.gait import STANDING, check_height, floor_ranges
from lme.types import Bools, Floats, Ints

Ranges = NDArray[np.float32]


class Streams(NamedTuple):
    """Random streams of one robot, spawned as `Sensors` spawns them."""

    scan: np.random.Generator
    goal: np.random.Generator
    odometry: np.random.Generator
    ripple: np.random.Generator
    tilt: np.random.Generator


_NO_STREAMS = Streams(*(np.random.default_rng(0) for _ in Streams._fields))  # before the first episode


class Sensing:
    """Disturbances of what N robots observe."""

    def __init__(self, robot: Robot, config: Disturbances, n: int) -> None:
        check_height(config.tilt, robot)
        self._lidar, self._config = robot.lidar, config
        self._streams: list[Streams] = [_NO_STREAMS] * n
        size = int(config.odometry_age / robot.dt) + 4
        first, counts = np.zeros(n, np.int64), np.zeros(n, np.int64)
        odometry, motions = (np.zeros((n, 3)), np.zeros((n, 3))), np.zeros((n, size, 9))
        fixes = np.zeros((n, 2)), np.zeros(n)
        self._estimates = Estimates(np.ones((n, 2)), *odometry, motions, first, counts, *fixes)
        self._ripple = np.array([config.ripple_v, config.ripple_omega])
        self._deviations = np.array([config.goal_noise, config.goal_noise, config.goal_noise_yaw])
        self._rate = float(
            config.goal_rate or 0.0
        )  # [Hz] 0: localisation sees the goal once, or in every step
        self._is_exact = config.goal_rate is None and not self._deviations.any()
        self._sways, self._pose_errors = np.zeros((n, 2)), np.zeros((n, 3))  # drawn for this step
        beams = np.arange(self._lidar.num_beams, dtype=np.float64)
        self._bearings = self._lidar.yaw + self._lidar.angle_min + self._lidar.angle_increment * beams

    def begin(self, i: int, rng: np.random.Generator, goal: Floats) -> None:
        """Start an episode of robot i."""
        scan, goal_rng = rng.spawn(2)
        streams = self._streams[i] = Streams(scan, goal_rng, *goal_rng.spawn(3))
        estimates = self._estimates
        estimates.scales[i] = 1.0 + self._config.odometry_error * streams.odometry.standard_normal(2)
        for array in (estimates.exact, estimates.measured, estimates.first, estimates.counts, estimates.dues):
            array[i] = 0
        estimates.fixes[i] = goal

    def ranges(self, robots: Ints, rngs: list[np.random.Generator], twists: Floats, ranges: Ranges) -> None:
        """Disturb the ranges (N, B) of robots (K,). rngs, of N robots, give the lidar's own noise; twists (N, 2)."""
        config, lidar = self._config, self._lidar
        noise, range_max = np.empty(lidar.num_beams, np.float32), float(lidar.range_max)
        for i, is_walking in zip(robots.tolist(), self._are_walking(robots, twists), strict=True):
            streams = self._streams[i]
            if config.tilt > 0.0 and is_walking:
                assert lidar.height is not None
                floor = floor_ranges(self._bearings, lidar.height, config.tilt, streams.tilt)
                np.minimum(ranges[i], floor, out=ranges[i], dtype=np.float32)
            for std, rng in ((lidar.noise_std, rngs[i]), (config.scan_noise, streams.scan)):
                if std > 0.0:
                    rng.standard_normal(dtype=np.float32, out=noise)
                    add_noise(ranges[i], noise, float(std), range_max)
            if config.scan_dropout > 0.0:
                lose_beams(ranges[i], config.scan_dropout, range_max, streams.scan)

    def motion(
        self, robots: Ints, states: States, goals: Floats, encoders: Encoders, targets: Floats, twists: Floats
    ) -> None:
        """Write targets (N, 2) [m] and twists (N, 2) of robots (K,) as they measure them. goals (N, 2) [m]."""
        config, estimates = self._config, self._estimates
        # Draw the sway of the gait, and the errors of localisation where it is due.
        if self._ripple.any():
            self._sways[robots] = 0.0
            for i in robots[self._are_walking(robots, encoders.twists)].tolist():
                self._sways[i] = self._ripple * self._streams[i].ripple.standard_normal(2)
        is_due = states.times >= (-1.0 if config.goal_rate is None else estimates.dues - 1e-9)
        if self._deviations.any():
            for i in robots[is_due[robots]].tolist():
                self._pose_errors[i] = self._deviations * self._streams[i].goal.standard_normal(3)
        drawn = self._sways, self._pose_errors, is_due
        rules = config.odometry_error > 0.0, self._is_exact, float(config.odometry_age), self._rate
        measure(robots, states, goals, encoders, *drawn, estimates, rules, targets, twists)

    @staticmethod
    def _are_walking(robots: Ints, twists: Floats) -> Bools:
        """Return whether the legs of robots (K,) are moving, as `is_walking` does."""
        return np.asarray(np.abs(twists[robots]).max(axis=1) > STANDING)
