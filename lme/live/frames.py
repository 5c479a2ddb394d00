"""Coordinate frames of a robot's messages: odometry, base and sensors, and the transforms between them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, NamedTuple

import numpy as np

from lme.live.messages import frame, matrix_of
from lme.types import Floats

_BASES = ("base_footprint", "base_link")
_ODOMS = ("odom", "map")


class TransformTree:
    """The latest transform from each frame to its parent, without interpolation in time."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Floats]] = {}

    def update(self, message: Any) -> None:
        """Add the transforms of a TFMessage."""
        for stamped in message.transforms:
            child = frame(stamped.child_frame_id)
            transform = matrix_of(stamped.transform.translation, stamped.transform.rotation)
            self._parents[child] = (frame(stamped.header.frame_id), transform)

    def copy(self) -> TransformTree:
        """Return an independent copy."""
        twin = TransformTree()
        twin._parents = dict(self._parents)
        return twin

    @property
    def names(self) -> set[str]:
        """Names of all frames."""
        return {*self._parents, *(parent for parent, _ in self._parents.values())}

    def chain(self, ancestor: str, name: str) -> set[str]:
        """Frames from `name` up to `ancestor`, without `ancestor`; empty if it is not an ancestor of `name`."""
        names = list(self._to_ancestors(name))
        return set(names[: names.index(ancestor)]) if ancestor in names else set()

    def lookup(self, target: str, source: str) -> Floats | None:
        """Transform (4, 4) from `source` to `target`; None if no chain of transforms connects them."""
        to_source, to_target = self._to_ancestors(source), self._to_ancestors(target)
        common = next((name for name in to_source if name in to_target), None)
        return None if common is None else np.asarray(np.linalg.inv(to_target[common]) @ to_source[common])

    def _to_ancestors(self, name: str) -> dict[str, Floats]:
        """Transforms (4, 4) from a frame to itself and to each of its ancestors, nearest first."""
        matrix = np.eye(4)
        transforms = {name: matrix}
        while name in self._parents and self._parents[name][0] not in transforms:  # stop at a cycle
            name, transform = self._parents[name]
            matrix = transform @ matrix
            transforms[name] = matrix
        return transforms


@dataclass(slots=True)
class FramesConfig:
    """Names of frames; None: from the odometry messages, else the usual names."""

    odom: str | None = None
    base: str | None = None


class Frames(NamedTuple):
    """Names of the odometry frame and the base frame."""

    odom: str
    base: str


class Carrier(Enum):
    """The part of the frame tree that a frame moves with; it decides whether a cloud in it must be levelled."""

    BASE = auto()  # it tilts as the base does
    LEVEL = auto()  # it is between both frames, such as base_footprint: it goes along, but is level
    ODOMETRY = auto()  # it is the odometry frame
    MAP = auto()  # it is above the odometry frame


def carrier_of(name: str, frames: Frames, tree: TransformTree) -> Carrier:
    """The carrier of a frame, as far as tf knows it."""
    if name == frames.odom:
        return Carrier.ODOMETRY
    if tree.chain(name, frames.odom):
        return Carrier.MAP
    return Carrier.LEVEL if tree.chain(name, frames.base) else Carrier.BASE


def tf_frames(config: FramesConfig, tree: TransformTree) -> Frames | None:
    """An odometry frame and a base frame that tf connects; None if there are none."""
    odoms = (frame(config.odom),) if config.odom else _ODOMS
    bases = (frame(config.base),) if config.base else _BASES
    pairs = (Frames(odom, base) for odom in odoms for base in bases)
    return next((pair for pair in pairs if tree.lookup(*pair) is not None), None)


def message_frames(config: FramesConfig, message: Any | None, tree: TransformTree) -> Frames:
    """The frames that a message with a pose names, or the usual ones. message: None if none has come yet.

    Motion capture may name the base anything: a name that tf does not know is replaced by a usual one that it knows.
    """
    odom = "" if message is None else frame(message.header.frame_id)
    child = frame(getattr(message, "child_frame_id", ""))
    if child and not (config.odom and config.base):
        odom, child = _in_order(odom, child)
    candidates = [name for name in (child, *_BASES) if name]
    base = next((name for name in candidates if name in tree.names), child or _BASES[1])
    chosen = frame(config.odom or odom or _ODOMS[0])
    if odom not in ("", chosen) and not _is_base(odom) and tree.lookup(chosen, odom) is not None:
        warnings.warn(
            f"odometry gives poses in {odom} (header.frame_id), and frames.odom is {chosen}: they are read as poses in "
            f"{chosen}, without the transform between the two; omit frames.odom for those in {odom}",
            stacklevel=2,
        )
    return Frames(chosen, frame(config.base or base))


def _in_order(odom: str, base: str) -> tuple[str, str]:
    """The odometry frame and the base frame, with names that a message confuses put right; "" for a missing one."""
    if odom == base:
        ordered = ("", base) if _is_base(base) else (odom, "")
    elif _is_odom(base) and _is_base(odom):
        ordered = base, odom
    else:
        return odom, base
    warnings.warn(
        f"odometry gives the pose of {base} in {odom} (child_frame_id, header.frame_id): read as that of "
        f"{ordered[1] or 'the base'} in {ordered[0] or 'the odometry frame'}; frames.odom and frames.base say "
        "otherwise",
        stacklevel=3,
    )
    return ordered


def _is_odom(name: str) -> bool:
    basename = name.rpartition("/")[2]
    return basename in _ODOMS or basename.endswith("odom")


def _is_base(name: str) -> bool:
    return name.rpartition("/")[2].startswith("base")
