"""Poses of the robot, from messages that hold one or from tf."""

from __future__ import annotations

from typing import Any, NamedTuple

from lme.live.frames import Frames
from lme.live.messages import (
    ODOMETRY,
    Tilt,
    frame,
    imu_rotation,
    planar_matrix,
    pose_matrix,
    pose_of,
    tilt_of,
    twist_of,
)
from lme.live.transforms import TransformTree
from lme.types import Pose, Twist

FARTHEST = 1e9  # [m], [rad] larger numbers come from a fault
FASTEST = 50.0  # [m/s], [rad/s] the same
TWISTS = (
    "measured",
    "poses",
)  # where velocities come from: the messages, as far as they have them, or the poses


class Sample(NamedTuple):
    """The pose of the base in the odometry frame, its header with the stamp, and the twist if the message has one.

    height [m], tilt: what the planar pose leaves out.
    """

    header: Any
    pose: Pose
    twist: Twist | None
    height: float
    tilt: Tilt


def is_sound(pose: Pose, twist: Twist | None) -> bool:
    """Whether all numbers are finite and of a size that a robot can have."""
    near = all(abs(number) <= FARTHEST for number in pose)
    return near and all(abs(number) <= FASTEST for number in twist or ())


def message_pose(message: Any, kind: str) -> Sample:
    """The pose in a message of type `kind`: Odometry, a pose or a transform."""
    matrix = pose_matrix(message, kind)
    twist = twist_of(message, kind) if kind == ODOMETRY else None
    return Sample(message.header, pose_of(message, kind), twist, float(matrix[2, 3]), tilt_of(matrix))


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
    if matrix is None:
        return None
    pose = planar_matrix(matrix)[0]
    return Sample(moved[-1].header, pose, None, float(matrix[2, 3]), tilt_of(matrix))


def imu_tilt(message: Any, frames: Frames, tree: TransformTree) -> Tilt | None:
    """Roll and pitch of the base by an Imu; None if that holds no orientation.

    An IMU that tf does not connect to the base is taken to have the axes of the base.
    """
    rotation = imu_rotation(message)
    to_base = tree.lookup(frames.base, frame(message.header.frame_id))
    if rotation is None:
        return None
    return tilt_of(rotation if to_base is None else rotation @ to_base[:3, :3].T)
