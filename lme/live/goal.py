"""The goal, given in any frame that tf connects to the odometry frame."""

from __future__ import annotations

import numpy as np

from lme.geometry.frames import to_robot, to_world
from lme.live.frames import Frames, TransformTree
from lme.live.messages import planar_matrix
from lme.live.poses import StampedMotion, Track
from lme.types import Floats

FARTHEST = 1e4  # [m] a goal farther away is a fault; some planners sample the way to it


class Goal:
    """A goal at a fixed point.

    Localisation moves a frame above the odometry frame, such as map, and a goal in it moves with it. A goal in any
    other frame is placed in the odometry frame once, at the robot's pose at the goal's stamp.
    """

    def __init__(self, point: Floats, frame: str, stamp: int) -> None:
        """Take a point (2,) [m] in `frame`, "" for the odometry frame, as it is at a stamp [ns]."""
        self._point, self.frame, self._stamp = point, frame, stamp
        self._position: Floats | None = None  # in the odometry frame

    def place(self, frames: Frames, tree: TransformTree, track: Track, tolerance: int) -> bool:
        """Find the goal in the odometry frame, and return whether tf and the poses allow it.

        tolerance: greatest time between the goal's stamp and a pose [ns].
        """
        if self._position is not None:
            return True
        if self.frame in ("", frames.odom):
            self._position = self._point
        elif self.frame != frames.base and (matrix := tree.lookup(frames.odom, self.frame)) is not None:
            # A goal in a frame above the odometry frame moves with it, so it is not placed once and for all.
            position = to_world(self._point, planar_matrix(matrix)[0])
            self._position = None if self._is_above_odometry(frames, tree) else position
            return True
        elif (matrix := tree.lookup(frames.base, self.frame)) is not None:
            # A goal in a frame of the robot: the pose at its stamp fixes it.
            motion = track.at(self._stamp, tolerance)
            on_base = to_world(self._point, planar_matrix(matrix)[0])
            self._position = None if motion is None else to_world(on_base, motion.pose)
        return self._position is not None

    def target(self, motion: StampedMotion, frames: Frames, tree: TransformTree) -> Floats | None:
        """The goal (2,) in the robot frame [m]; not transformed if it was given there at the stamp of the motion.

        None if tf does not connect its frame, or puts it absurdly far away.
        """
        target = self._in_robot_frame(motion, frames, tree)
        return target if target is not None and (np.abs(target) <= FARTHEST).all() else None

    def _in_robot_frame(self, motion: StampedMotion, frames: Frames, tree: TransformTree) -> Floats | None:
        if self.frame == frames.base and self._stamp == motion.stamp:
            return self._point
        if self._position is not None:
            return to_robot(self._position, motion.pose)
        matrix = tree.lookup(frames.odom, self.frame) if self._is_above_odometry(frames, tree) else None
        if matrix is None:
            return None
        return to_robot(to_world(self._point, planar_matrix(matrix)[0]), motion.pose)

    def _is_above_odometry(self, frames: Frames, tree: TransformTree) -> bool:
        return bool(tree.chain(self.frame, frames.odom))
