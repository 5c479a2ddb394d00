"""Commands that a planner tried before it chose one, for displays of its decisions."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from lme.types import Floats, Guidance, Observation


class Weighed(NamedTuple):
    """Commands (N, 2), v and ω [m/s, rad/s], and their costs (N,); inf: refused. The least cost is chosen.

    horizon: least time for which a command is assumed to be held [s].
    """

    commands: Floats
    costs: Floats
    horizon: float


@runtime_checkable
class Weighing(Protocol):
    """Planner that tries several commands and can tell the cost of each."""

    def weighed(self, observation: Observation, guidance: Guidance) -> Weighed:
        """Return the commands that `plan` would try now. Changes no state."""
