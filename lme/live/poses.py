"""Poses of the robot, from messages that hold one or from tf."""

from __future__ import annotations

from typing import Any, NamedTuple

from lme.live.frames import Frames
from lme.live.messages import ODOMETRY, frame, planar_matrix, pose_of, twist_of
from lme.live.transforms import TransformTree
from lme.types import Pose, Twist

FARTHEST = 1e9  # [m], [rad] larger numbers come from a fault
FASTEST = 50.0  # [m/s], [rad/s] the same


class Sample(NamedTuple):
    """The pose of the base in the odometry frame, its header with the stamp, and the twist if the message has one."""

    header: Any
    pose: Pose
    twist: Twist | None


def is_sound(pose: Pose, twist: Twist | None) -> bool:
    """Whether all numbers are finite and of a size that a robot can have."""
    near = all(abs(number) <= FARTHEST for number in pose)
    return near and all(abs(number) <= FASTEST for number in twist or ())


def message_pose(message: Any, kind: str) -> Sample:
    """The pose in a message of type `kind`: Odometry, a pose or a transform."""
    return Sample(
        message.header, pose_of(message, kind), twist_of(message, kind) if kind == ODOMETRY else None
    )


def moving_links(tree: TransformTree, frames: Frames) -> set[str]:
    """The child frames whose transforms say where the base is now.

    The transform from the map to the odometry frame only corrects them. Its stamp may lie in the future: AMCL's does.
    """
    chain = tree.chain(*frames)
    return {name for name in chain if name == frames.base or not name.endswith("odom")}


def tf_pose(message: Any, tree: TransformTree, frames: Frames) -> Sample | None:
    """The pose of the base by tf, if the TFMessage says where it is now. `tree` already holds the message."""
    links = moving_links(tree, frames)
    moved = [one for one in message.transforms if frame(one.child_frame_id) in links]
    matrix = tree.lookup(*frames) if moved else None
    return None if matrix is None else Sample(moved[-1].header, planar_matrix(matrix)[0], None)
