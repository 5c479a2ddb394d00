"""Watch over the node's clock: the robot stops if it jumps or stands still."""

from __future__ import annotations

from collections.abc import Callable

from lme.live.messages import SECOND

_JITTER = SECOND // 10  # [ns] threads may read the clock in one order and report it in another


class Clock:
    """The latest time on the node's clock. Simulated time may jump or stand still.

    time_jump [ns]: a clock that advances by more than this between two readings has jumped. wall: monotonic time [ns].
    """

    def __init__(self, time_jump: int, wall: Callable[[], int]) -> None:
        self._time_jump, self._wall = time_jump, wall
        self._latest: int | None = None
        self._advanced_at = wall()

    def read(self, now_ns: int) -> str:
        """Note the time `now_ns`, and describe how the clock has jumped; "" if it has not."""
        latest, self._latest = self._latest, now_ns
        if latest is None or now_ns > latest:
            self._advanced_at = self._wall()
        if latest is None or -_JITTER <= now_ns - latest <= self._time_jump:
            self._latest = now_ns if latest is None else max(now_ns, latest)
            return ""
        direction = "forwards" if now_ns > latest else "backwards"
        return f"the clock jumped {direction} by {abs(now_ns - latest) / SECOND:.3g} s"

    @property
    def stalled_for(self) -> int:
        """Wall time since the clock last advanced [ns]."""
        return self._wall() - self._advanced_at
