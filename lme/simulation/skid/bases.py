"""Bases that move the robot in `sim=skid`: sliding wheels, or the measured response of a real robot."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Protocol

import numpy as np

from lme.drivetrain import Drivetrain, Response
from lme.geometry.frames import compose
from lme.robots import Footprint
from lme.simulation.disturbances import Delay, slipped
from lme.simulation.gait import GaitResponse
from lme.simulation.skid.kernels import Chassis, WheelState, slide
from lme.simulation.substeps import Wheels, rolled, track
from lme.types import Floats, Limits, Pose, Twist


class Base(Protocol):
    """Base of the robot, which owns the pose.

    twist: over ground, v straight ahead. measured: speed of the wheels and true turn rate, as encoders and gyro give
    them. reckoned: x, y (2,) in the world, dead-reckoned by the wheels' speed along the measured yaw since the start.
    """

    pose: Pose
    twist: Twist
    measured: Twist
    reckoned: Floats

    def drive(
        self, command: Twist, duration: float, count: int, factors: tuple[float, float], yaw_errors: Floats
    ) -> Floats:
        """Drive for `duration` [s] and return (count, 3) poses at equal times.

        factors: ground per metre of tread, left and right. yaw_errors: of the measured yaw [rad], in equal parts of
        the time.
        """


class SlidingBase:
    """Wheels on a floor with friction."""

    def __init__(
        self, drivetrain: Drivetrain, start: Pose, axes: int, lag: float, gait: GaitResponse | None = None
    ) -> None:
        """lag: time constant of the wheels' controller [s]. gait: response that the controller follows."""
        self._gait = gait
        parameters = asdict(drivetrain)
        controller = parameters.pop("controller")
        multiplier, _ = controller.pop("separation_multiplier"), controller.pop("timeout")
        self._chassis = Chassis(**parameters, separation_multiplier=multiplier, lag=lag)
        self._limits = tuple(controller.values())
        self._axes = axes
        self._state = WheelState(np.zeros(6), np.zeros(4), np.zeros(2), np.zeros(16), np.zeros(2))
        self._state.body[:3] = compose(start, Pose(drivetrain.com_x, 0.0, 0.0))
        self._state.odometry[:] = start[:2]
        self.pose, self.twist, self.measured = start, Twist(0.0, 0.0), Twist(0.0, 0.0)
        self.reckoned = self._state.odometry

    def drive(
        self, command: Twist, duration: float, count: int, factors: tuple[float, float], yaw_errors: Floats
    ) -> Floats:
        """See `Base`."""
        state = self._state
        if self._gait:
            distance, angle = self._gait.follow(command, duration)
            command = Twist(distance / duration, angle / duration)
        poses = slide(
            state, self._chassis, command, self._limits, factors, self._axes, yaw_errors, duration, count
        )
        self.pose = Pose(*poses[-1].tolist())
        vx, vy, omega = state.body[3:].tolist()
        self.twist = Twist(vx * math.cos(self.pose.yaw) + vy * math.sin(self.pose.yaw), omega)
        self.measured = Twist(float(state.wheels[0]), omega)
        return poses


class RespondingBase:
    """Measured response of a real robot. The wheels are assumed to do what the controller commands.

    Encoders therefore give the ground velocity divided by its gain, and odometry drifts accordingly.
    """

    def __init__(
        self,
        response: Response,
        footprint: Footprint,
        start: Pose,
        lag: float,
        gait: GaitResponse | None = None,
    ) -> None:
        """lag: time constant of the velocity over ground [s]; it and the gait add to the measured response."""
        self._response = response
        self._track = track(footprint)
        self._limits = Limits(math.inf, math.inf, response.alpha_v, response.alpha_omega)
        self._ground = Wheels(lag, gait)  # its twist is the ground velocity
        self._delay_v, self._delay_omega = Delay(response.delay_v), Delay(response.delay_omega)
        self._time = 0.0
        self.pose, self.twist, self.measured = start, Twist(0.0, 0.0), Twist(0.0, 0.0)
        self.reckoned = np.array(start[:2])

    def drive(
        self, command: Twist, duration: float, count: int, factors: tuple[float, float], yaw_errors: Floats
    ) -> Floats:
        """See `Base`."""
        scaled = Twist(command.v * self._response.gain_v, command.omega * self._response.gain_omega)
        self._delay_v.send(scaled, self._time)
        self._delay_omega.send(scaled, self._time)
        poses, dt = np.empty((count, 3)), duration / count
        for k in range(count):
            poses[k] = self._roll(dt, factors, float(yaw_errors[k * len(yaw_errors) // count]))
        ground = self._ground.twist
        self.measured = Twist(ground.v / self._response.gain_v, ground.omega)
        return poses

    def _roll(self, dt: float, factors: tuple[float, float], yaw_error: float) -> Pose:
        """Roll for `dt` [s]; a delayed command takes effect in the first piece whose middle is at or past its time."""
        middle = self._time + dt / 2
        active = Twist(self._delay_v.at(middle).v, self._delay_omega.at(middle).omega)
        distance, angle = self._ground.turn(active, self._limits, dt)
        motion = slipped((distance, angle), factors, self._track)
        heading = self.pose.yaw + motion[1] / 2 + yaw_error
        self.reckoned += distance / self._response.gain_v * np.array([math.cos(heading), math.sin(heading)])
        self.pose, self.twist = rolled(self.pose, motion), Twist(motion[0] / dt, motion[1] / dt)
        self._time += dt
        return self.pose
