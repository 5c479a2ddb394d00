"""Types shared by all modules: poses, commands, scans, observations, outcomes, guides and planners.

Frames follow REP-103: x ahead, y left, angles counter-clockwise in radians. The "robot frame" is the base
frame of the robot at the moment of the observation.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

_ROUNDING = 1e-9  # [m/s, rad/s]


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
    """The robot's limits: v_max [m/s], omega_max [rad/s], alpha_v [m/s²], alpha_omega [rad/s²], v_min [m/s].

    The robot backs up no faster than −v_max, or than v_min if that is slower. With v_min=0 it cannot back up.
    """

    v_max: float
    omega_max: float
    alpha_v: float
    alpha_omega: float
    v_min: float = -math.inf

    @property
    def lowest(self) -> float:
        """Lowest velocity, which is that of backing up: −v_max, or v_min if that is nearer to 0 [m/s]."""
        return max(-self.v_max, self.v_min)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """(v_max, omega_max, alpha_v, alpha_omega) as a plain tuple, for compiled functions and networks."""
        return self[:4]

    def clamped(self, twist: Twist) -> Twist:
        """Return the nearest twist within the limits of velocity. An excess within rounding error stays as it is."""
        v, omega = twist
        if not self.lowest - _ROUNDING <= v <= self.v_max + _ROUNDING:
            v = min(max(v, self.lowest), self.v_max)
        if not -self.omega_max - _ROUNDING <= omega <= self.omega_max + _ROUNDING:
            omega = min(max(omega, -self.omega_max), self.omega_max)
        return Twist(v, omega)


_NOBODY: Floats = np.empty((0, 4))
_NOBODY.flags.writeable = False


class LaserScan(NamedTuple):
    """One sweep of a 2D lidar, in the lidar's own frame, as in ROS `sensor_msgs/LaserScan`.

    ranges: (num_beams,) float32 [m]. Inf, NaN, values below range_min and values ≥ range_max mean "no return". Behind
    NaN nothing is known to be free: the measurement failed (REP-117).
    """

    ranges: NDArray[np.float32]
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float


class Observation(NamedTuple):
    """Input of guide and planner: {scan, p_T, v, ω, v_max, ω_max, α_v, α_ω} (paper §III.A) and odometry.

    target: (2,) position of the goal in the robot frame [m]. odometry: pose of the base in the odometry frame, the base
    frame at the start of the episode, for guides and planners that keep a map or a band; LME reads it where the twist
    does not explain it (`lme.perception.dead_reckoning`). pedestrians: (P, 4) x, y [m] and vx, vy [m/s] over ground
    of the people in sight, all in the robot frame, as a tracker of people would give them; empty without a tracker.
    The scan holds their returns too, from which planners take the radius of a person. LME does not read pedestrians.
    scan_pose: pose of the base in the odometry frame when the scan was taken; None: `odometry`. Only maps with an
    `update_rate` read it.

    twist: the measured twist. last_command: the command that the robot follows; None: the navigator fills in its own
    last one. closed_loop: the next command ramps from the measured twist instead of the last command.
    """

    scan: LaserScan
    target: Floats
    twist: Twist
    limits: Limits
    odometry: Pose
    pedestrians: Floats = _NOBODY
    scan_pose: Pose | None = None
    last_command: Twist | None = None
    closed_loop: bool = False

    @property
    def ramp_start(self) -> Twist:
        """The twist from which the next command ramps, within the limits of velocity [m/s, rad/s].

        It is the last command, so that commands do not follow the motion of a robot that overshoots, sways or reports
        no speed. With `closed_loop`, or where no last command is known, it is the measured twist.
        """
        start = self.twist if self.closed_loop else self.twists[-1]
        return self.limits.clamped(start)

    @property
    def twists(self) -> tuple[Twist, ...]:
        """The measured twist, and the last command if it differs from that by more than rounding.

        A stopping check must pass with each of them.
        """
        command, measured = self.last_command, self.twist
        if command is None or (
            abs(command.v - measured.v) <= _ROUNDING and abs(command.omega - measured.omega) <= _ROUNDING
        ):
            return (measured,)
        return measured, command


class Guidance(NamedTuple):
    """Output of a guide, input of a planner.

    subgoal: (2,) in the robot frame [m]. path: (K, 2) in the robot frame [m] if the guide plans one.
    switched: the guide has switched to another subgoal. blocked: the guide found no free path. points: (M, 2) all
    obstacle points that the guide knows, in the robot frame [m], if it remembers some that are not in the scan. way:
    (K, 2) points of the route that it expects to be the fastest, in the robot frame [m], if it plans no path.
    """

    subgoal: Floats
    path: Floats | None = None
    switched: bool = False
    blocked: bool = False
    points: Floats | None = None
    way: Floats | None = None


class Feedback(StrEnum):
    """The twist from which a command ramps, in the terms of Nav2's velocity smoother.

    OPEN_LOOP: from the last command. CLOSED_LOOP: from the measured twist, as in the paper. Both are kept within the
    limits. They are the same where the robot moves exactly as commanded, as in `sim=fast` without disturbances.
    """

    OPEN_LOOP = "OPEN_LOOP"
    CLOSED_LOOP = "CLOSED_LOOP"


class Outcome(StrEnum):
    """Outcome of an episode."""

    SUCCESS = "success"
    COLLISION = "collision"
    TIMEOUT = "timeout"


class Guide(Protocol):
    """A component that decides where to go next, and keeps its own state."""

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` is the only source of randomness."""

    def guide(self, observation: Observation) -> Guidance:
        """Return the subgoal for this step."""


class Planner(Protocol):
    """A component that decides how to reach a subgoal, and keeps its own state."""

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` is the only source of randomness."""

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the velocity command for this step, within `observation.limits`."""
