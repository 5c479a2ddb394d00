"""What the simulator needs of a robot in MuJoCo, on legs or on wheels."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lme.simulation.crowd import Crowd
from lme.simulation.simulator import State
from lme.types import Floats, Pose, Twist
from lme.worlds.world import World

FALLEN_TILT = 0.9  # [rad] of the body, beyond which a robot has fallen


class Readings(NamedTuple):
    """What the robot measures: twist, odometry from the start, and the newest scan.

    scan_pose: where it was taken; None: at the current pose. ranges (num_beams,): [m]; None: cast from the scan pose.
    """

    twist: Twist
    odometry: Pose
    scan_pose: Pose | None = None
    ranges: NDArray[np.float32] | None = None


class Machine(Protocol):
    """A robot's body in an arena, what moves it, and the sensors that it carries.

    time_step [s] of the physics; piece: steps after which movers, arrival and the path are up to date. contact: the
    part that touches an obstacle, or FALL; empty for none. pose: of the base on the floor. velocity (3,): ahead, to
    the left, and about the vertical [m/s, m/s, rad/s]. legs: see `State`. joints (Q,): MuJoCo's coordinates of body and
    joints of a robot on legs; None on wheels.
    """

    time_step: float
    piece: int

    @property
    def contact(self) -> str: ...

    @property
    def pose(self) -> Pose: ...

    @property
    def velocity(self) -> Floats: ...

    @property
    def legs(self) -> Floats | None: ...

    @property
    def joints(self) -> Floats | None: ...

    def begin(self, start: Pose, rng: np.random.Generator) -> None:
        """Prepare an episode from this pose. `rng` is for the sensors."""

    def enter(self, world: World, crowd: Crowd) -> None:
        """Stand at the start, or, if the episode has begun, go on among other obstacles."""

    def move(self, command: Twist, steps: int) -> int:
        """Drive for steps of the physics, or until a part touches an obstacle; return how many were made."""

    def look(self, time: float, made: int, left: int, circles: Floats, edges: Floats) -> None:
        """Take what sensors measure on the way: the last `made` steps, with `left` steps to the end of the period.

        time [s]; circles (C, 3) and edges (E, 4): the current obstacles, those of the world first.
        """

    def read(self, state: State, circles: Floats, edges: Floats) -> Readings:
        """Return what is measured at the end of a period."""
