"""The node's messages on /diagnostics."""

from __future__ import annotations

import time
from typing import Any

from lme.live.step import LiveState, LiveStep
from runners.ros.outgoing import OK, WARN, OutgoingMessages

_NAME = "lme: navigation"
_PERIOD = 1.0  # [s] of real time between messages


class Status:
    """Statistics of the steps since the last message."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._decisions: list[float] = []
        self._tracking: list[float] = []
        self._people = 0

    def count(self, step: LiveStep) -> None:
        """Add a step."""
        if step.guidance is not None:
            self._decisions.append(step.decision_us)
        if step.people is not None:
            self._tracking.append(step.people_us)
            self._people = len(step.people.names)

    @property
    def due(self) -> bool:
        """Return whether the next message is due."""
        return time.monotonic() - self._began >= _PERIOD

    def message(self, step: LiveStep, soft_stops: int, make: OutgoingMessages) -> Any:
        """Return a diagnostic_msgs/DiagnosticArray for the time since the last one. soft_stops: total so far."""
        seconds = time.monotonic() - self._began
        decision_times = self._decisions
        values = {
            "state": step.state,
            "decisions per second": round(len(decision_times) / seconds, 1),
            "median decision [ms]": round(sorted(decision_times)[len(decision_times) // 2] / 1000.0, 2)
            if decision_times
            else "-",
            "longest decision [ms]": round(max(decision_times) / 1000.0, 2) if decision_times else "-",
            "soft stops": soft_stops,
        }
        if self._tracking:
            middle = sorted(self._tracking)[len(self._tracking) // 2]
            values |= {"people": self._people, "median tracking [ms]": round(middle / 1000.0, 2)}
        level = WARN if step.state is LiveState.STOPPED else OK
        text = f"{step.state}: {step.reason}" if step.reason else str(step.state)
        self._began, self._decisions, self._tracking = time.monotonic(), [], []
        return make.diagnostics(step.stamp, _NAME, level, text, values)
