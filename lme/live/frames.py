"""The two frames that poses relate: the odometry frame and the robot's base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from lme.live.messages import frame
from lme.live.transforms import TransformTree

_BASES = ("base_footprint", "base_link")
_ODOMS = ("odom", "map")


@dataclass(slots=True)
class FramesConfig:
    """Names of frames; None: from the odometry messages, else the usual names."""

    odom: str | None = None
    base: str | None = None


class Frames(NamedTuple):
    """Names of the odometry frame and the base frame."""

    odom: str
    base: str


def tf_frames(config: FramesConfig, tree: TransformTree) -> Frames | None:
    """An odometry frame and a base frame that tf connects; None if there are none."""
    odoms = (frame(config.odom),) if config.odom else _ODOMS
    bases = (frame(config.base),) if config.base else _BASES
    pairs = (Frames(odom, base) for odom in odoms for base in bases)
    return next((pair for pair in pairs if tree.lookup(*pair) is not None), None)


def message_frames(config: FramesConfig, message: Any | None, tree: TransformTree) -> Frames:
    """The frames that a message with a pose names, or the usual ones. message: None if none came yet.

    Motion capture may name the base anything: a name that tf does not know is replaced by a usual one that it knows.
    """
    odom = "" if message is None else frame(message.header.frame_id)
    named = frame(getattr(message, "child_frame_id", ""))
    candidates = [name for name in (named, *_BASES) if name]
    base = next((name for name in candidates if name in tree.names), named or _BASES[1])
    return Frames(frame(config.odom or odom or _ODOMS[0]), frame(config.base or base))
