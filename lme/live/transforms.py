"""Transforms between frames: the last one of each frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from lme.live.messages import frame, matrix_of
from lme.types import Floats


class TransformTree:
    """The latest transform from each frame to its parent, without interpolation in time."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Floats]] = {}

    def update(self, message: Any) -> None:
        """Add the transforms of a TFMessage."""
        for one in message.transforms:
            child = frame(one.child_frame_id)
            transform = matrix_of(one.transform.translation, one.transform.rotation)
            self._parents[child] = (frame(one.header.frame_id), transform)

    def copy(self) -> TransformTree:
        """An independent copy."""
        twin = TransformTree()
        twin._parents = dict(self._parents)
        return twin

    @property
    def names(self) -> set[str]:
        """Names of all frames."""
        return {*self._parents, *(parent for parent, _ in self._parents.values())}

    def chain(self, ancestor: str, name: str) -> set[str]:
        """Frames from `name` up to `ancestor`, without `ancestor`; empty if it is not an ancestor of `name`."""
        found = list(self._to_ancestors(name))
        return set(found[: found.index(ancestor)]) if ancestor in found else set()

    def lookup(self, target: str, source: str) -> Floats | None:
        """Transform (4, 4) from `source` to `target`; None if no chain of transforms connects them."""
        up, down = self._to_ancestors(source), self._to_ancestors(target)
        common = next((name for name in up if name in down), None)
        return None if common is None else np.asarray(np.linalg.inv(down[common]) @ up[common])

    def _to_ancestors(self, name: str) -> dict[str, Floats]:
        """Transforms (4, 4) from a frame to itself and to each of its ancestors, nearest first."""
        matrix = np.eye(4)
        found = {name: matrix}
        while name in self._parents and self._parents[name][0] not in found:  # stop at a cycle
            name, transform = self._parents[name]
            matrix = transform @ matrix
            found[name] = matrix
        return found
