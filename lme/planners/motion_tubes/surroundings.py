"""Memory of earlier scans for the area outside the lidar's current field of view."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import relative, to_world
from lme.planners.motion_tubes.kernels import Ranges, known_free, out_of_sight
from lme.planners.motion_tubes.tubes import LidarView
from lme.robots import Footprint
from lme.types import Bools, Floats, Pose


class Surroundings:
    """Latest scans and the robot's poses in the odometry frame. Obstacles are assumed to be static.

    A scan is kept if the robot has moved or turned enough since the last kept scan; the oldest scan is dropped.
    """

    def __init__(self, footprint: Footprint, capacity: int, spacing: float, turn: float) -> None:
        self._box = footprint.box
        self._capacity, self._spacing, self._turn = capacity, spacing, turn
        self.forget()

    def forget(self) -> None:
        """Forget all scans."""
        self._poses: list[Pose] = []
        self._ranges: list[Ranges] = []
        self._hits: list[Floats] = []  # of each scan, in the odometry frame
        self._view: LidarView | None = None

    def see(self, odometry: Pose, view: LidarView, free_ranges: Ranges, points: Floats) -> None:
        """Add a scan. It replaces the last one if the robot has not moved enough between the last two.

        points (M, 2): its obstacle points in the base frame [m].
        """
        if view != self._view:
            self.forget()
            self._view = view
        if len(self._poses) > 1 and not self._moved(self._poses[-2], self._poses[-1]):
            self._poses.pop()
            self._ranges.pop()
            self._hits.pop()
        self._poses.append(odometry)
        self._ranges.append(free_ranges)
        self._hits.append(to_world(points, odometry))
        for memory in (self._poses, self._ranges, self._hits):
            del memory[: -self._capacity]

    def hidden_hits(self, reach: float) -> Floats:
        """Return earlier points within `reach` of the base that are out of view now, in its frame: (K, 2) [m]."""
        view = self._view
        assert view is not None
        lidar = (view.x, view.y, view.first)
        hits = np.concatenate(self._hits)
        return np.asarray(out_of_sight(hits, self._poses[-1], lidar, view.increment, view.num_beams, reach))

    def known_free(self, points: Floats) -> Bools:
        """Return whether the robot has stood on or seen past each of the points (P, 2) in the base frame: (P,)."""
        view, bodies, lidars, ranges = self._in_base_frame()
        return np.asarray(known_free(points, bodies, lidars, ranges, view.increment, self._box))

    def _moved(self, previous: Pose, current: Pose) -> bool:
        _, _, turn = relative(current, previous)
        return math.dist(previous[:2], current[:2]) >= self._spacing or abs(turn) >= self._turn

    def _in_base_frame(self) -> tuple[LidarView, Floats, Floats, Ranges]:
        """Return the view, poses of base and lidar (M, 3) in the current base frame, ranges (M, B); newest first."""
        view = self._view
        assert view is not None
        bodies = np.array([relative(pose, self._poses[-1]) for pose in reversed(self._poses)])
        lidars = np.empty_like(bodies)
        lidars[:, 2] = bodies[:, 2] + view.first
        cos, sin = np.cos(bodies[:, 2]), np.sin(bodies[:, 2])
        lidars[:, 0] = bodies[:, 0] + cos * view.x - sin * view.y
        lidars[:, 1] = bodies[:, 1] + sin * view.x + cos * view.y
        return view, bodies, lidars, np.stack(self._ranges[::-1])
