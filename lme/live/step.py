"""The result of one control period of the live driver."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from lme.guides.lme.explanation import Explanation
from lme.live.poses import StampedMotion
from lme.perception.people.interface import Tracks
from lme.types import Guidance, Observation, Twist

STILL = Twist(0.0, 0.0)


class LiveState(StrEnum):
    """The robot's activity. STOPPED: it stands for safety, and continues once the reason is gone."""

    IDLE = "idle"
    DRIVING = "driving"
    ARRIVED = "arrived"
    CANCELLED = "cancelled"
    STOPPED = "stopped"


class LiveStep(NamedTuple):
    """One control period.

    stamp: time of the tick [ns]. reason: why the robot stands; "" while it drives. command: what to send now, within
    all limits. goal: number of the goal, from 1; 0 before the first. wanted: the navigator's command.
    observation, guidance, wanted: None if there was no decision. explanation: of the guide's decision; None if it made
    none in this period, or cannot explain itself. soft_stopped: the wanted command would have led into contact.
    decision_us: computing time of the decision [µs], with the tracking of people. motion: the latest pose and twist;
    None if none is known. people: who were tracked; None without a tracker. people_us: computing time of that [µs].
    taken: stamp of the scan [ns].
    """

    stamp: int
    state: LiveState
    reason: str
    command: Twist = STILL
    goal: int = 0
    observation: Observation | None = None
    guidance: Guidance | None = None
    explanation: Explanation | None = None
    wanted: Twist | None = None
    soft_stopped: bool = False
    decision_us: float = 0.0
    motion: StampedMotion | None = None
    people: Tracks | None = None
    people_us: float = 0.0
    taken: int = 0

    @property
    def text(self) -> str:
        """Description of what the robot does and why, for display."""
        return str(self.state) if self.reason in ("", self.state) else f"{self.state}: {self.reason}"


class NotReadyError(Exception):
    """The robot must stand; the message says why."""

    def __init__(self, reason: str, state: LiveState = LiveState.STOPPED) -> None:
        super().__init__(reason)
        self.state = state
