"""Memory of the obstacle points in a lidar's blind arc."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import to_robot, to_world
from lme.grids.polar_histogram import active_cells
from lme.perception.scan_points import is_full_circle, obstacle_points
from lme.types import Bools, Floats, LaserScan, Observation, Pose

_CELL = 0.05  # [m]
_NONE = np.empty((0, 2))


class BlindArc:
    """Memory of obstacle points, in the odometry frame, while they are within `reach` [m] and in the blind arc.

    One point is kept for all those in a cell of side `cell` [m], at their mean. A lidar with a full circle has no
    blind arc.
    """

    def __init__(self, mount: Pose, reach: float, cell: float = _CELL) -> None:
        self._mount = mount
        self._reach, self._cell = reach, cell
        self._remembered = _NONE  # in the odometry frame

    def points(self, observation: Observation) -> Floats:
        """Points of the current scan and remembered points in the blind arc, in the robot frame: (M, 2) [m].

        The order is arbitrary. Call it at every step.
        """
        points = obstacle_points(observation.scan, self._mount)
        if is_full_circle(observation.scan):
            return points
        if len(self._remembered) > 0:
            remembered = to_robot(self._remembered, observation.odometry)
            points = np.concatenate((points, remembered[self._unseen(remembered, observation.scan)]))
        self._remembered = to_world(active_cells(points, self._cell, self._reach), observation.odometry)
        return points

    def _unseen(self, points: Floats, scan: LaserScan) -> Bools:
        """Return whether each point lies more than half an increment outside the field of view."""
        at_lidar = to_robot(points, self._mount)
        half_fov = 0.5 * len(scan.ranges) * abs(scan.angle_increment)
        middle = scan.angle_min + 0.5 * (len(scan.ranges) - 1) * scan.angle_increment
        bearings = np.arctan2(at_lidar[:, 1], at_lidar[:, 0]) - middle
        is_hidden: Bools = np.cos(bearings) < math.cos(half_fov)
        return is_hidden
