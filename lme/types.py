"""The words every other module speaks: poses, commands, scans, observations, outcomes.

Frames follow REP-103: x ahead, y left, angles counter-clockwise in radians. "Robot frame" is the base
frame of the robot at the moment of the observation.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]


class Pose(NamedTuple):
    """Position [m] and heading [rad] of a frame in its parent frame."""

    x: float
    y: float
    yaw: float


class Twist(NamedTuple):
    """Forward velocity [m/s] and turn rate [rad/s]."""

    v: float
    omega: float


class Limits(NamedTuple):
    """What the robot can do: v_max [m/s], omega_max [rad/s], alpha_v [m/s²], alpha_omega [rad/s²]."""

    v_max: float
    omega_max: float
    alpha_v: float
    alpha_omega: float


class LaserScan(NamedTuple):
    """One sweep of a 2D lidar, in the lidar's own frame, as in ROS `sensor_msgs/LaserScan`.

    ranges: (num_beams,) float32 [m]; inf, NaN, below range_min or at range_max and beyond mean "no return".
    """

    ranges: NDArray[np.float32]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float


class Observation(NamedTuple):
    """What the policy sees (paper §III.A), {scan, p_T, v, ω, v_max, ω_max, α_v, α_ω}, and the odometry.

    target: (2,) position of the goal in the robot frame [m]. odometry: pose of the base in the frame where
    the base was when the episode began, for guides and planners that keep a map or a band; LME never reads it.
    """

    scan: LaserScan
    target: Floats
    twist: Twist
    limits: Limits
    odometry: Pose


class Guidance(NamedTuple):
    """Where a guide sends the planner.

    subgoal: (2,) in the robot frame [m]. path: (K, 2) in the robot frame [m] where the guide plans one.
    switched: the subgoal is not the one followed before. blocked: the guide found no free way there.
    """

    subgoal: Floats
    path: Floats | None = None
    switched: bool = False
    blocked: bool = False


class Outcome(StrEnum):
    """How an episode ended."""

    SUCCESS = "success"
    COLLISION = "collision"
    TIMEOUT = "timeout"


class Guide(Protocol):
    """Decides where to go next. Owns its state."""

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""

    def guide(self, observation: Observation) -> Guidance:
        """Subgoal for this step."""


class Planner(Protocol):
    """Decides how to get to a subgoal. Owns its state."""

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Velocity command for this step, within `observation.limits`."""
