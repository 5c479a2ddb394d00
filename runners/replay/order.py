"""Checks that the time of a topic increases."""

from __future__ import annotations

from lme.errors import InputError
from lme.live.messages import SECOND

_JITTER = SECOND // 10  # messages up to this late are ignored: threads may swap them


class Order:
    """Checks that the stamps of a topic increase."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._last: int | None = None

    def accepts(self, stamp: int) -> bool:
        """Whether `stamp` [ns] is later than all before it. Raises InputError if time jumps back."""
        if self._last is not None and stamp < self._last - _JITTER:
            back = (self._last - stamp) / SECOND
            raise InputError(
                f"topics: the time of {self._topic} goes backwards by {back:.3g} s (stamp {stamp / SECOND:.3f} s): "
                "use clock=recorded, or cut the recording with start= and end="
            )
        later = self._last is None or stamp > self._last
        if later:
            self._last = stamp
        return later
