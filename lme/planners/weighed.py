"""The commands that a planner tried before it chose one, for those who watch it think."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

from lme.types import Floats, Guidance, Observation


class Weighed(NamedTuple):
    """Commands (N, 2), v and ω [m/s, rad/s], and their costs (N,); inf: refused. The least cost is chosen.

    horizon: for how long a command is thought to be held [s], at least.
    """

    commands: Floats
    costs: Floats
    horizon: float


@runtime_checkable
class Weighing(Protocol):
    """A planner that tries several commands and can say what it thinks of each."""

    def weighed(self, observation: Observation, guidance: Guidance) -> Weighed:
        """What `plan` would try now. Changes no state."""
