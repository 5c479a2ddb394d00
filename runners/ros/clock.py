"""The clock of the node: the system clock, or /clock."""

from __future__ import annotations

import time
from typing import Any

from lme.live.messages import nanoseconds


class SystemClock:
    """Time since 1970, as in the stamps of robots' drivers."""

    seconds_still = 0.0

    def now(self) -> int | None:
        """Return the time [ns]."""
        return time.time_ns()


class TopicClock:
    """The latest time on /clock."""

    def __init__(self) -> None:
        self._now: int | None = None
        self._moved = time.monotonic()

    def take(self, message: Any) -> None:
        """Process a rosgraph_msgs/Clock."""
        time_ns = nanoseconds(message.clock)
        if time_ns != self._now:
            self._now, self._moved = time_ns, time.monotonic()

    def now(self) -> int | None:
        """Return the time [ns]; None before the first message."""
        return self._now

    @property
    def seconds_still(self) -> float:
        """Return the real time since the clock last advanced [s]."""
        return time.monotonic() - self._moved
