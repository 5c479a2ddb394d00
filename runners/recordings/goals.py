"""The goal of a replay: a fixed point, or the messages of a topic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_robot
from lme.live.frames import TransformTree
from lme.live.goal import Goal
from lme.live.messages import frame
from lme.live.poses import StampedMotion, Track
from lme.types import Floats
from runners.recordings.bags import Message
from runners.recordings.recording import Recording

LAST = "last"


class GoalSource(Protocol):
    """A source of the goal, which may move."""

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Process a message of the goal's topic."""

    def target(self, motion: StampedMotion, tree: TransformTree) -> Floats | None:
        """Return the goal (2,) in the robot frame [m]; None if there is none yet."""


class FixedGoal:
    """A fixed point (2,) in the odometry frame [m]."""

    def __init__(self, point: Sequence[float]) -> None:
        self._point = np.array(point, dtype=np.float64)

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Do nothing, since the goal does not move."""

    def target(self, motion: StampedMotion, tree: TransformTree) -> Floats | None:
        """Return the point in the robot frame [m]."""
        return to_robot(self._point, motion.pose)


class TopicGoal:
    """The last pose on a topic, in any frame that tf connects to the odometry frame."""

    def __init__(self, recording: Recording, tolerance: int) -> None:
        self._recording = recording
        self._tolerance = tolerance
        self._goal: Goal | None = None

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Keep the pose. Raises InputError if tf does not connect its frame to the odometry frame."""
        frames, name = self._recording.frames, frame(message.content.header.frame_id)
        if name and all(tree.lookup(frame_name, name) is None for frame_name in frames):
            raise InputError(
                f"goal: it is given in the frame {name}, which tf does not connect to {frames.odom}: "
                "give [x, y] in the odometry frame"
            )
        position = message.content.pose.position
        point = np.array([float(position.x), float(position.y)])
        self._goal = Goal(point, name, self._recording.stamp(message))
        self._goal.place(frames, tree, track, self._tolerance)

    def target(self, motion: StampedMotion, tree: TransformTree) -> Floats | None:
        """Return the goal (2,) in the robot frame [m]; None before the first message."""
        return None if self._goal is None else self._goal.target(motion, self._recording.frames, tree)


def goal_source(requested: Any, recording: Recording, stop: int | None, tolerance: int) -> GoalSource:
    """Return the source of the goal that `goal=` gives. stop: end of the replay [ns, clock of the file]."""
    if recording.topics.goal is not None:
        return TopicGoal(recording, tolerance)
    return FixedGoal(recording.last_pose(stop)[:2] if requested is None or requested == LAST else requested)


def topic_of(requested: Any) -> str | None:
    """Return the topic that `goal=` names; None for a point or no value. Raises InputError for anything else."""
    if requested is None or isinstance(requested, str):
        return None if requested in (None, LAST) else requested
    numbers = isinstance(requested, Sequence) and all(isinstance(v, int | float) for v in requested)
    if not numbers or len(requested) != 2 or not np.isfinite(list(requested)).all():
        raise InputError(
            f"goal is {requested!r}: must be [x, y] in the odometry frame [m], a topic, or {LAST}"
        )
    return None
