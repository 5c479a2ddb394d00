"""The frames of a recording: what tf said last about each."""

from __future__ import annotations

from typing import Any

import numpy as np

from lme.types import Floats
from runners.replay.messages import frame, matrix_of


class TransformTree:
    """Latest transform of each frame in its parent; time is the recording's, nothing is interpolated."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Floats]] = {}

    def update(self, message: Any) -> set[str]:
        """Take in a TFMessage; the child frames that it names."""
        named = set()
        for one in message.transforms:
            child = frame(one.child_frame_id)
            transform = matrix_of(one.transform.translation, one.transform.rotation)
            self._parents[child] = (frame(one.header.frame_id), transform)
            named.add(child)
        return named

    def copy(self) -> TransformTree:
        """Another tree that knows the same now."""
        twin = TransformTree()
        twin._parents = dict(self._parents)
        return twin

    @property
    def names(self) -> set[str]:
        """All frames."""
        return {*self._parents, *(parent for parent, _ in self._parents.values())}

    def chain(self, ancestor: str, name: str) -> set[str]:
        """Frames on the way up from `name` to `ancestor`, the last left out; empty where there is no such way."""
        way = list(self._to_ancestors(name))
        return set(way[: way.index(ancestor)]) if ancestor in way else set()

    def lookup(self, target: str, source: str) -> Floats | None:
        """(4, 4) from `source` to `target`; None where no chain of transforms joins them."""
        up, down = self._to_ancestors(source), self._to_ancestors(target)
        common = next((name for name in up if name in down), None)
        return None if common is None else np.asarray(np.linalg.inv(down[common]) @ up[common])

    def _to_ancestors(self, name: str) -> dict[str, Floats]:
        """Transforms from a frame to itself, its parent, and so on up."""
        matrix = np.eye(4)
        found = {name: matrix}
        while name in self._parents and self._parents[name][0] not in found:  # else the frames form a ring
            name, transform = self._parents[name]
            matrix = transform @ matrix
            found[name] = matrix
        return found
