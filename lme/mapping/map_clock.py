"""The clock of a map that is rebuilt in a thread of its own, as the costmaps of ROS are."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lme.geometry.frames import between
from lme.types import LaserScan, Observation, Pose


class MapInput(NamedTuple):
    """Input of a rebuilt map: a scan, and the robot's poses when it was taken and when the map is rebuilt.

    Both poses are those of the base in the odometry frame.
    """

    scan: LaserScan
    scan_pose: Pose
    pose: Pose


class MapClock:
    """Schedule of a map that is rebuilt, with the inputs.

    Without a rate, the map is rebuilt at every observation, from its scan, at its pose. With a rate [Hz], it is
    rebuilt at a phase that is drawn per episode, mostly between two observations: from the scan of the earlier one,
    at the pose in between. The planner then plans from a newer pose than that of the map. A map that is rebuilt more
    than once between two observations is only that of the last time. Time is counted in control periods of `dt` [s].

    Source: ros-planning/navigation, costmap_2d_ros.cpp (mapUpdateLoop, updateMap) and obstacle_layer.cpp, which
    projects a scan at its stamp, and takes it 0.05 s later at the earliest.
    """

    def __init__(self, rate: float | None, dt: float) -> None:
        self._rate, self._dt = rate, dt
        self._previous: Observation | None = None

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode. The phase is drawn from a stream of its own."""
        self._previous = None
        self._time = 0.0
        if self._rate is not None:
            self._phase = rng.spawn(1)[0].uniform() / self._rate

    def due(self, observation: Observation) -> MapInput | None:
        """Return the input of the map before this observation is planned on; None if it is not rebuilt.

        The first observation is taken as it is, since a robot at rest has a map.
        """
        previous, self._previous = self._previous, observation
        if self._rate is None:
            return MapInput(observation.scan, observation.odometry, observation.odometry)
        if previous is None:
            return _input(observation, observation.odometry)
        begin, self._time = self._time, self._time + self._dt
        # The last tick in the period that has ended, and the pose at it.
        tick = self._phase + math.floor((self._time - self._phase) * self._rate) / self._rate
        if tick <= begin:
            return None
        return _input(previous, between(previous.odometry, observation.odometry, (tick - begin) / self._dt))


def _input(observation: Observation, pose: Pose) -> MapInput:
    return MapInput(observation.scan, observation.scan_pose or observation.odometry, pose)
