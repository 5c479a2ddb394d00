"""Where the replayed robot is to go."""

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
    """A goal that may move."""

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Look at a message of the goal's topic."""

    def target(self, motion: StampedMotion) -> Floats | None:
        """(2,) in the robot frame [m]; None while there is none."""


class FixedGoal:
    """A point in the odometry frame [m]."""

    def __init__(self, point: Sequence[float]) -> None:
        self._point = np.array(point, dtype=np.float64)

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """It does not move."""

    def target(self, motion: StampedMotion) -> Floats | None:
        """The point from where the robot is."""
        return to_robot(self._point, motion.pose)


class TopicGoal:
    """The last pose on a topic: in the base frame where the robot was then, in the odometry frame, or by tf."""

    def __init__(self, recording: Recording, tolerance: int) -> None:
        self._recording = recording
        self._tolerance = tolerance
        self._newest: tuple[int, Floats] | None = None  # stamp [ns] and place in the base frame then
        self._point: Floats | None = None  # in the odometry frame

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Raises InputError where its frame is not joined to the odometry frame."""
        name = frame(message.content.header.frame_id)
        pose = planar(message.content.pose.position, message.content.pose.orientation)
        place, stamp = np.array(pose[:2]), self._recording.stamp(message)
        self._newest = None
        if name in ("", self._recording.odom):
            self._point = place
        elif name == self._recording.base:
            self._newest, self._point = (stamp, place), None
            self._settle(track)
        else:
            self._point = to_world(place, planar_matrix(self._to_odom(tree, name))[0])

    def target(self, motion: StampedMotion) -> Floats | None:
        """Exactly as the topic has it where it is told for this very instant."""
        if self._newest is not None and self._newest[0] == motion.stamp:
            return self._newest[1]
        return None if self._point is None else to_robot(self._point, motion.pose)

    def _settle(self, track: Track) -> None:
        """Fix a goal told in the base frame to the ground."""
        assert self._newest is not None
        motion = track.at(self._newest[0], self._tolerance)
        self._point = None if motion is None else to_world(self._newest[1], motion.pose)

    def _to_odom(self, tree: TransformTree, name: str) -> Floats:
        matrix = tree.lookup(self._recording.odom, name)
        if matrix is None:
            raise InputError(
                f"goal: it is told in the frame {name}, and tf does not join that to {self._recording.odom}: "
                "give [x, y] in the odometry frame"
            )
        return matrix


def goal_of(asked: Any, recording: Recording, stop: int | None, tolerance: int) -> GoalSource:
    """The goal that `goal=` asks for; stop: where the replay ends [ns of the file's clock]."""
    if recording.topics.goal is not None:
        return TopicGoal(recording, tolerance)
    return FixedGoal(recording.last_pose(stop)[:2] if asked is None or asked == LAST else asked)


def topic_of(asked: Any) -> str | None:
    """The topic that `goal=` names, None where it is a point or left open. Raises InputError for anything else."""
    if asked is None or isinstance(asked, str):
        return None if asked in (None, LAST) else asked
    numbers = isinstance(asked, Sequence) and all(isinstance(v, int | float) for v in asked)
    if not numbers or len(asked) != 2 or not np.isfinite(list(asked)).all():
        raise InputError(f"goal is {asked!r}: must be [x, y] in the odometry frame [m], a topic, or {LAST}")
    return None
