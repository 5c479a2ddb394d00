"""Velocity commands: those within a robot's limits, those after which it can stop, and the costs of those tried."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from lme.errors import argument_error, require
from lme.geometry.collision import sweep
from lme.geometry.motion import drive
from lme.robots import Robot, reachable, towards
from lme.types import Floats, Guidance, Limits, Observation, Pose, Twist

MOST_SAMPLES = 1001  # of v and of ω: a planner holds values of every pair
_AT_REST = 1e-6  # [m/s, rad/s] slower than this counts as 0
_FACTORS = (1.0, 0.7, 0.45, 0.25, 0.12, 0.05)  # of the wanted twist, on the same arc
_STEP = 0.02  # [m] no point of the outline moves further between two checks
_SHORTEST_STOP = 1e-3  # [s]
_NOISE = 1.0  # standard deviations of the lidar's noise added to the margin
_NO_EDGES = np.empty((0, 4))
_CENTRE = (0.0, 0.0, 0.0)
_ORIGIN = Pose(0.0, 0.0, 0.0)


def without_tiny_rates(twist: Twist) -> Twist:
    """Return the twist with rates that are too small to matter set to 0, since their quotients would overflow."""
    v, omega = twist
    return Twist(v if abs(v) > _AT_REST else 0.0, omega if abs(omega) > _AT_REST else 0.0)


def limited(v: float, omega: float, observation: Observation, dt: float) -> Twist:
    """Return the command nearest to (v, ω) that the limits allow within one period `dt` [s] of `ramp_start`."""
    return reachable(v, omega, observation.ramp_start, observation.limits, dt)


def approach(error: float, rate: float, rate_max: float, alpha: float, dt: float) -> float:
    """Return the rate that drives `error` to zero as fast as possible without overshoot.

    Accelerates at `alpha` up to `rate_max`, then brakes at `alpha`. It is the largest rate such that braking at
    `alpha` after one more period, which starts at `rate`, covers no more than `error`.
    """
    sign = math.copysign(1.0, error)
    ahead, speed = abs(error), max(sign * rate, 0.0)
    braking = speed * speed / (2.0 * alpha)
    if speed * dt + braking <= ahead:  # may speed up: u·dt − (u − speed)²/2α + u²/2α = ahead
        reachable = (ahead + braking) / (dt + speed / alpha)
    else:  # must slow down: (speed² − u²)/2α + u·(dt − (speed − u)/α) + u²/2α = ahead
        slack = speed - alpha * dt
        reachable = (slack + math.sqrt(max(slack * slack + 4.0 * alpha * (ahead - braking), 0.0))) / 2.0
        reachable = max(reachable, 0.0) if ahead > braking else 0.0
    return towards(sign * min(rate_max, reachable), rate, alpha, dt)


def check_turn_samples(number: int) -> None:
    """Raise InputError unless this number of turn rates, `omega_samples`, can have 0 in its middle."""
    require("omega_samples", number, at_least=3, at_most=MOST_SAMPLES)
    if number % 2 == 0:
        raise argument_error(f"omega_samples is {number}: must be odd, so that the robot may drive straight")


def turn_shares(number: int) -> Floats:
    """Return an odd number of shares of a range of turn rates, −1 to 1, exactly symmetric: (number,)."""
    half = np.linspace(0.0, 1.0, number // 2 + 1)
    return np.concatenate((-half[:0:-1], half))


class StoppingGuard:
    """Slows a command along its arc, or to a turn in place, until one period and a full stop are collision-free."""

    def __init__(self, robot: Robot, margin: float) -> None:
        self._robot = robot
        self._box = robot.footprint.box
        self._dt = robot.dt
        self._margin = margin + _NOISE * robot.lidar.noise_std
        self._room = robot.r + self._margin

    def guard(self, desired: Twist, observation: Observation, points: Floats) -> Twist:
        """Return the first clear command of `desired`, slower ones on its arc, and its turn in place; else brake.

        points (M, 2): obstacle points in the robot frame [m]. A command is clear if the outline keeps `margin` [m]
        plus one standard deviation of the lidar's noise. Unless it turns in place, the disc of the collision
        radius must keep the same distance, so that the robot can still turn where it stops. A robot that is nearer
        already may use commands that bring it no nearer. The result is within the limits.
        """
        command = limited(*desired, observation, self._dt)
        if len(points) == 0:
            return command
        circles = np.column_stack((points, np.zeros(len(points))))
        pose = np.array([_ORIGIN])
        min_clearance = min(self._margin, sweep(pose, self._box, circles, _NO_EDGES)[0] - 1e-6)
        room = min(self._room, sweep(pose, _CENTRE, circles, _NO_EDGES)[0] - 1e-6)
        # The command, slower ones on the same arc, then turns in place.
        on_arc = [(factor * desired.v, factor * desired.omega) for factor in _FACTORS]
        for v, omega in (*on_arc, (0.0, desired.omega), (0.0, 0.3 * desired.omega)):
            command = limited(v, omega, observation, self._dt)
            if self._clear(command, observation, circles, min_clearance, room):
                return command
        return limited(0.0, 0.0, observation, self._dt)

    def _clear(
        self, command: Twist, observation: Observation, circles: Floats, min_clearance: float, room: float
    ) -> bool:
        """Return whether outline and centre keep `min_clearance` and `room` [m] over one period and braking."""
        for twist in observation.twists:
            poses = until_rest(command, twist, observation.limits, self._robot)
            clearance, contact = sweep(poses, self._box, circles, _NO_EDGES)
            if contact >= 0 or clearance < min_clearance:
                return False
            if command.v != 0.0 and sweep(poses, _CENTRE, circles, _NO_EDGES)[0] < room:
                return False
        return True


def until_rest(command: Twist, start: Twist, limits: Limits, robot: Robot, max_step: float = _STEP) -> Floats:
    """Poses (K, 3) in the robot frame over one period of the command, from the twist `start`, and a full stop.

    No point of the outline moves farther than `max_step` [m] between two poses.
    """
    reach = robot.footprint.circumscribed_radius
    travel, twist = drive(_ORIGIN, start, command, limits.bounds, robot.dt, max_step, reach)
    braking = max(abs(twist[0]) / limits.alpha_v, abs(twist[1]) / limits.alpha_omega, _SHORTEST_STOP)
    stop, _ = drive(Pose(*travel[-1].tolist()), twist, (0.0, 0.0), limits.bounds, braking, max_step, reach)
    return np.vstack((travel, stop))


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
