"""Sources of `Observation.pedestrians`: what the simulator knows, the tracker, or nobody."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum, auto
from time import perf_counter_ns
from typing import Protocol

import numpy as np

from lme.errors import InputError
from lme.perception.people.interface import PeopleConfig, Tracks
from lme.robots import Robot
from lme.types import Observation


class People(StrEnum):
    """Source of the people in `Observation.pedestrians`, by its name in a config.

    truth: those whom the simulator puts there. tracked: those whom the tracker finds in the scans. none: nobody.
    """

    truth = auto()
    tracked = auto()
    none = auto()


class PeopleSource(Protocol):
    """Source of people in observations. tracks: of the last one, if it tracks. spent_us: computing time [µs]."""

    tracks: Tracks | None
    spent_us: float

    def reset(self) -> None:
        """Start a new episode."""

    def seen(self, observation: Observation, time: float | None) -> Observation:
        """Return the observation with these people. time: of the scan [s]; None: a control period after the last."""


class Nobody:
    """Source that leaves everybody out."""

    tracks: Tracks | None = None
    spent_us = 0.0

    def reset(self) -> None:
        """Do nothing: there is no state."""

    def seen(self, observation: Observation, time: float | None) -> Observation:
        """Return the observation without people."""
        return observation._replace(pedestrians=observation.pedestrians[:0])


class TrackedPeople:
    """Source that finds people in the scans."""

    def __init__(self, robot: Robot, config: PeopleConfig | None = None) -> None:
        from lme.perception.people.tracker import (
            PeopleTracker,  # compiles, which takes seconds the first time
        )

        self._tracker = PeopleTracker(config or PeopleConfig(), robot.lidar.mount)
        self._dt = robot.dt
        self.reset()

    def reset(self) -> None:
        """Forget everybody."""
        self._tracker.reset()
        self._time = math.nan
        self.tracks: Tracks | None = None
        self.spent_us = 0.0

    def seen(self, observation: Observation, time: float | None) -> Observation:
        """Return the observation with the tracks. A scan that is not newer than the last one changes nothing."""
        start_ns = perf_counter_ns()
        dt = self._dt if time is None or math.isnan(self._time) else time - self._time
        self._time = self._time + dt if time is None else time
        self.tracks = self._tracker.update(observation.scan, observation.odometry, dt)
        self.spent_us = (perf_counter_ns() - start_ns) / 1000.0
        return observation._replace(pedestrians=np.ascontiguousarray(self.tracks.pedestrians))


def people_source(choice: str, robot: Robot) -> PeopleSource | None:
    """Create the source of a config's `people`; None: observations keep the people whom they have.

    Raises InputError for another choice.
    """
    sources: dict[str, Callable[[], PeopleSource | None]] = {
        "truth": lambda: None,
        "tracked": lambda: TrackedPeople(robot),
        "none": Nobody,
    }
    if choice not in sources:
        raise InputError(f"people is {choice!r}: must be one of {', '.join(sources)}")
    return sources[choice]()
