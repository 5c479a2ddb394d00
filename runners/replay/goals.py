"""The goal of a replay: a fixed point, or the messages of a topic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_robot, to_world
from lme.types import Floats
from runners.replay.bags import Message
from runners.replay.messages import frame, planar, planar_matrix
from runners.replay.recording import Recording
from runners.replay.track import StampedMotion, Track
from runners.replay.transforms import TransformTree

LAST = "last"


class GoalSource(Protocol):
    """Provides the goal, which may move."""

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Process a message of the goal's topic."""

    def target(self, motion: StampedMotion) -> Floats | None:
        """The goal (2,) in the robot frame [m]; None if there is none yet."""


class FixedGoal:
    """A fixed point (2,) in the odometry frame [m]."""

    def __init__(self, point: Sequence[float]) -> None:
        self._point = np.array(point, dtype=np.float64)

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Does nothing: the goal does not move."""

    def target(self, motion: StampedMotion) -> Floats | None:
        """The point in the robot frame [m]."""
        return to_robot(self._point, motion.pose)


class TopicGoal:
    """The last pose on a topic, given in the base frame at its stamp, the odometry frame, or a frame known to tf."""

    def __init__(self, recording: Recording, tolerance: int) -> None:
        self._recording = recording
        self._tolerance = tolerance
        self._newest: tuple[int, Floats] | None = None  # stamp [ns] and point in the base frame at that time
        self._point: Floats | None = None  # in the odometry frame

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Keep the pose. Raises InputError if tf does not connect its frame to the odometry frame."""
        name = frame(message.content.header.frame_id)
        pose = planar(message.content.pose.position, message.content.pose.orientation)
        point, stamp = np.array(pose[:2]), self._recording.stamp(message)
        self._newest = None
        if name in ("", self._recording.odom):
            self._point = point
        elif name == self._recording.base:
            self._newest, self._point = (stamp, point), None
            self._settle(track)
        else:
            self._point = to_world(point, planar_matrix(self._to_odom(tree, name))[0])

    def target(self, motion: StampedMotion) -> Floats | None:
        """The goal (2,) in the robot frame [m]; not transformed if the message has the stamp of the motion."""
        if self._newest is not None and self._newest[0] == motion.stamp:
            return self._newest[1]
        return None if self._point is None else to_robot(self._point, motion.pose)

    def _settle(self, track: Track) -> None:
        """Transform a goal in the base frame to the odometry frame."""
        assert self._newest is not None
        motion = track.at(self._newest[0], self._tolerance)
        self._point = None if motion is None else to_world(self._newest[1], motion.pose)

    def _to_odom(self, tree: TransformTree, name: str) -> Floats:
        matrix = tree.lookup(self._recording.odom, name)
        if matrix is None:
            raise InputError(
                f"goal: it is given in the frame {name}, which tf does not connect to {self._recording.odom}: "
                "give [x, y] in the odometry frame"
            )
        return matrix


def goal_of(asked: Any, recording: Recording, stop: int | None, tolerance: int) -> GoalSource:
    """The goal that `goal=` asks for. stop: end of the replay [ns, clock of the file]."""
    if recording.topics.goal is not None:
        return TopicGoal(recording, tolerance)
    return FixedGoal(recording.last_pose(stop)[:2] if asked is None or asked == LAST else asked)


def topic_of(asked: Any) -> str | None:
    """The topic that `goal=` names; None if it is a point or not set. Raises InputError for anything else."""
    if asked is None or isinstance(asked, str):
        return None if asked in (None, LAST) else asked
    numbers = isinstance(asked, Sequence) and all(isinstance(v, int | float) for v in asked)
    if not numbers or len(asked) != 2 or not np.isfinite(list(asked)).all():
        raise InputError(f"goal is {asked!r}: must be [x, y] in the odometry frame [m], a topic, or {LAST}")
    return None
