"""Settings of the live driver."""

from __future__ import annotations

from dataclasses import dataclass

from lme.errors import InputError, require

CLOCKS = ("header", "received")


@dataclass(slots=True)
class LiveConfig:
    """When the robot must stand, and when it has arrived."""

    stale: float = 0.5  # [s] older scans, poses and transforms stop the robot
    time_jump: float = (
        1.0  # [s] ASSUMED: a clock that advances by more than this between two calls has jumped
    )
    goal_tolerance: float = 0.2  # [m] ASSUMED: as for map=env1
    soft_stop: bool = True  # stop if the robot would touch what the lidar sees before it could stand
    clock: str = "header"  # header: the messages' stamps | received: the times at which they arrive
    seed: int = 0  # of the guide's and planner's random numbers

    def __post_init__(self) -> None:
        for key in ("stale", "time_jump", "goal_tolerance"):
            require(f"live.{key}", getattr(self, key), above=0.0)
        require("live.seed", self.seed, at_least=0)
        if self.clock not in CLOCKS:
            raise InputError(f"live.clock is {self.clock!r}: must be one of {', '.join(CLOCKS)}")
