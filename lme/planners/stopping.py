"""Last check of a command: the robot must be able to stop before every obstacle point."""

from __future__ import annotations

import numpy as np

from lme.geometry.collision import sweep
from lme.geometry.motion import drive
from lme.planners.commands import limited
from lme.robots import Robot
from lme.types import Floats, Limits, Observation, Pose, Twist

_FACTORS = (1.0, 0.7, 0.45, 0.25, 0.12, 0.05)  # of the wanted twist, on the same arc
_STEP = 0.02  # [m] no point of the outline moves further between two checks
_SHORTEST_STOP = 1e-3  # [s]
_NOISE = 1.0  # standard deviations of the lidar's noise added to the margin
_NO_EDGES = np.empty((0, 4))
_CENTRE = (0.0, 0.0, 0.0)
_ORIGIN = Pose(0.0, 0.0, 0.0)


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
        for v, omega in _slower(desired):
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


def _slower(desired: Twist) -> list[tuple[float, float]]:
    """List the command, slower ones on the same arc, then turns in place."""
    on_arc = [(factor * desired.v, factor * desired.omega) for factor in _FACTORS]
    return [*on_arc, (0.0, desired.omega), (0.0, 0.3 * desired.omega)]
