"""Observation of the policy: its parts, each in the form on which the policy was trained."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError, argument_error
from lme.planners.onnx.config import OnnxConfig, OnnxScanConfig, OnnxTargetConfig
from lme.robots import Robot
from lme.types import Floats, LaserScan, Observation

Part = NDArray[np.float32]


class OnnxFeatures:
    """Parts of the observation that `inputs` names, as float32 vectors.

    The arithmetic is that of `lme.gym`, in float32 and in the same order, so that an environment's observation and
    this one are equal to the last bit. Raises InputError unless `planner.scan.beams` divides the lidar's beams.
    """

    def __init__(self, config: OnnxConfig, robot: Robot) -> None:
        have, wanted = robot.lidar.num_beams, config.scan.beams
        if wanted is not None and have % wanted:
            raise argument_error(f"scan.beams is {wanted}: must divide the lidar's {have}")
        self._config, self._beams = config, have if wanted is None else wanted
        self._have = have
        known = {"scan": self._beams, "target": 2, "twist": 2, "limits": 4, "action": 2}
        self.sizes = {part: known[part] for part in config.inputs}

    def of(self, observation: Observation, subgoal: Floats, action: Floats) -> dict[str, Part]:
        """Return the parts at one step. subgoal: (2,) in the robot frame [m]; action: the last outputs (2,)."""
        config = self._config
        units = np.array([config.twist.v or 1.0, config.twist.omega or 1.0], dtype=np.float32)
        twist: Part = np.array(observation.twist, dtype=np.float32) / units
        made: dict[str, Part] = {
            "scan": self._scan(observation.scan),
            "target": target_part(subgoal, config.target),
            "twist": twist,
            "limits": np.array(observation.limits.bounds, dtype=np.float32),
            "action": action.astype(np.float32),
        }
        return {part: made[part] for part in self.sizes}

    def _scan(self, scan: LaserScan) -> Part:
        if len(scan.ranges) == 0:  # nothing is in sight
            scan = scan._replace(ranges=np.full(self._have, np.inf, dtype=np.float32))
        if len(scan.ranges) != self._have:
            raise InputError(
                f"the scan has {len(scan.ranges)} beams, but robot.lidar.num_beams is {self._have}: must be equal"
            )
        return scan_part(scan, self._beams, self._config.scan)


def scan_part(scan: LaserScan, beams: int, config: OnnxScanConfig) -> Part:
    """Ranges from right to left: (beams,). A beam without a return has range_max."""
    ranges = np.where(np.isnan(scan.ranges), np.float32(np.inf), scan.ranges)
    if scan.angle_increment < 0.0:
        ranges = ranges[::-1]
    nearest = np.minimum(ranges, np.float32(scan.range_max)).reshape(beams, -1).min(axis=1)
    clip = scan.range_max if config.clip is None else config.clip
    cut: Part = np.minimum(nearest, clip)
    if config.scaled is None:
        return cut
    low, high = config.scaled
    return cut / clip * (high - low) + low


def target_part(subgoal: Floats, config: OnnxTargetConfig) -> Part:
    """Target (2,): x and y, or distance and bearing. With `reach`, in shares of it, the bearing in shares of π."""
    target: Part = subgoal.astype(np.float32)
    away = np.hypot(target[:1], target[1:])
    if config.form == "polar":
        bearing = np.arctan2(target[1:], target[:1])
        if config.reach is None:
            return np.concatenate([away, bearing])
        return np.concatenate([np.minimum(away / config.reach, 1.0), bearing / math.pi]).astype(np.float32)
    return target if config.reach is None else (target / np.maximum(config.reach, away)).astype(np.float32)
