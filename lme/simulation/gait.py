"""Walking gait: velocity that overshoots the command, a measured twist that ripples, and a lidar that tilts.

The model is fitted to a Unitree Go2 that walks in MuJoCo; `conf/sim/walking.yaml` has its values and their source.

A tilt affects only a planar lidar, whose beams then meet the floor. The cloud of a 3D lidar (`robot.lidar.cloud`) is
levelled by the estimated attitude, as in lidar-inertial odometry, so its points stay where they were hit and the floor
stays below the heights that make the scan. The tilt still moves the sensor by a few millimetres, less than the
lidar's own noise, so the scan of a cloud does not change.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit

from lme.errors import argument_error
from lme.robots import Robot
from lme.simulation.disturbances import Disturbances
from lme.types import Floats, Twist

STANDING = 0.02  # [m/s, rad/s] a robot that is slower stands still: nothing ripples or tilts
ROLL_SHARE = 0.5  # [-] of the pitch's standard deviation: 1.3° of 2.3° for the Go2 at 0.66 m/s


def is_walking(twist: Twist) -> bool:
    """Return whether the legs are moving."""
    return max(abs(twist.v), abs(twist.omega)) > STANDING


def damping_ratio(overshoot: float) -> float:
    """Damping ratio [-] at which a step of the command is overshot by this share; 1, critical, for 0."""
    if overshoot == 0.0:
        return 1.0
    return -math.log(overshoot) / math.hypot(math.pi, math.log(overshoot))


class GaitResponse:
    """Second-order response of v and ω, each called y here, to a command u: y'' = f² (u − y) − 2 ζ f y'.

    An axis with f = 0 follows its command at once. A step is exact for a command that is constant within it, so steps
    of any length are stable.
    """

    def __init__(self, natural_frequencies: tuple[float, float], overshoots: tuple[float, float]) -> None:
        """natural_frequencies: f of v and of ω [rad/s].

        overshoots: of a step in v and in ω [-], which give ζ (`damping_ratio`).
        """
        self.twist = Twist(0.0, 0.0)
        self._frequencies = natural_frequencies
        self._dampings = [damping_ratio(overshoot) for overshoot in overshoots]
        self._rates = [0.0, 0.0]  # y'/f of v and of ω

    def follow(self, command: tuple[float, float], dt: float) -> tuple[float, float]:
        """Return distance [m] and turn [rad] in the next `dt` [s] under a command v [m/s], ω [rad/s]."""
        motion, reached = [0.0, 0.0], [0.0, 0.0]
        for axis in range(2):
            if self._frequencies[axis] == 0.0:
                motion[axis], reached[axis] = command[axis] * dt, command[axis]
                continue
            transition = transition_of(self._frequencies[axis], self._dampings[axis], dt)
            state = (self.twist[axis], self._rates[axis], float(command[axis]))
            motion[axis], reached[axis], self._rates[axis] = respond(transition, *state)
        self.twist = Twist(*reached)
        return motion[0], motion[1]


def response_of(config: Disturbances) -> GaitResponse | None:
    """Return the response of a robot at rest; None if its wheels follow the command directly."""
    if not config.has_gait:
        return None
    frequencies = (config.natural_frequency_v, config.natural_frequency_omega)
    return GaitResponse(frequencies, (config.overshoot_v, config.overshoot_omega))


@njit(cache=True, error_model="numpy")
def respond(transition: Floats, y: float, rate: float, u: float) -> tuple[float, float, float]:
    """Return the integral of y over a step, and y and y'/f after it. transition (3, 3): `transition_of`; rate: y'/f."""
    motion = transition[0, 0] * y + transition[0, 1] * rate + transition[0, 2] * u
    reached = transition[1, 0] * y + transition[1, 1] * rate + transition[1, 2] * u
    return motion, reached, transition[2, 0] * y + transition[2, 1] * rate + transition[2, 2] * u


@lru_cache(maxsize=1024)
def transition_of(frequency: float, damping: float, dt: float) -> Floats:
    """Matrix (3, 3) from (y, y'/f, u) to the integral of y over dt and y, y'/f after it: a matrix exponential."""
    from scipy.linalg import expm

    rates = np.zeros((4, 4))  # of (integral, y, y'/f, u)
    rates[0, 1] = 1.0
    rates[1, 2] = frequency
    rates[2, 1:] = -frequency, -2.0 * damping * frequency, frequency
    return np.ascontiguousarray(expm(rates * dt)[:3, 1:])


def rippled(twist: Twist, ripple_v: float, ripple_omega: float, rng: np.random.Generator) -> Twist:
    """Add white noise of these standard deviations [m/s, rad/s] to the measured twist.

    The body and its twist sway with every stride. The sway is only a centimetre or two and a degree, so the pose is
    not changed. White noise is a simplification: at 8 Hz successive twists of the Go2 correlate by −.35 to .26,
    and a faster control loop would see a smoother ripple.
    """
    v, omega = rng.normal((twist.v, twist.omega), (ripple_v, ripple_omega)).tolist()
    return Twist(v, omega)


def floor_ranges(bearings: Floats, height: float, tilt: float, rng: np.random.Generator) -> Floats:
    """Ranges (B,) [m] at which the beams of a tilted planar lidar meet the floor; inf for beams that rise.

    bearings (B,) in the base frame [rad]; height of the lidar above the floor [m]. Pitch is drawn with the standard
    deviation `tilt` [rad] and roll with `ROLL_SHARE` of it. A beam dips by pitch·cos(bearing) + roll·sin(bearing), and
    meets the floor at height / sin(dip). Ranges to upright obstacles change by only 1 % at 9° and are not changed.
    """
    pitch, roll = rng.normal(0.0, (tilt, ROLL_SHARE * tilt))
    dips = pitch * np.cos(bearings) + roll * np.sin(bearings)
    ranges = np.full(len(bearings), math.inf)
    np.divide(height, np.sin(dips), out=ranges, where=dips > 0.0)
    return ranges


def check_height(tilt: float, robot: Robot) -> None:
    """Raise InputError for a planar lidar that tilts at an unknown height."""
    if tilt > 0.0 and robot.lidar.cloud is None and robot.lidar.height is None:
        raise argument_error(
            f"tilt is {tilt:g}, but robot.lidar.height is null in robot {robot.name}: must be the height of the "
            "planar lidar above the floor [m], where tilted beams end; or set tilt to 0"
        )
