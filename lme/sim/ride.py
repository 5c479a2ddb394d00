"""A ride in short slices of time: what delay, slip, movers and rigid bodies need."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from lme.geometry.frames import compose
from lme.kernels.collision import sweep
from lme.robots import Footprint, Robot
from lme.sim.crowd import Crowd
from lme.sim.disturbances import Delay, Disturbances, slip_factors, slipped
from lme.sim.simulator import State
from lme.types import Floats, Limits, Pose, Twist
from lme.worlds.world import Task


class Body(Protocol):
    """What the wheels move. Owns its pose."""

    pose: Pose
    twist: Twist  # over ground

    def move(self, motion: tuple[float, float], dt: float) -> None:
        """Roll on by a distance [m] and a turn [rad] within `dt` [s]; the movers are already ahead by dt."""

    def touches(self, clearance: float) -> bool:
        """Whether it is in contact; `clearance` is the distance between the bare shapes [m]."""


class Wheels:
    """Two driven wheels that follow commands within the limits and count their turns.

    twist: of the tread; odometry: pose of the base in the frame where the ride began, as the wheels count it.
    """

    def __init__(self) -> None:
        self.twist = Twist(0.0, 0.0)
        self.odometry = Pose(0.0, 0.0, 0.0)

    def turn(self, command: Twist, limits: Limits, dt: float) -> tuple[float, float]:
        """Distance [m] and turn [rad] of the tread in `dt` [s], each velocity ramping at its own limit."""
        v_goal = min(max(command.v, -limits.v_max), limits.v_max)
        omega_goal = min(max(command.omega, -limits.omega_max), limits.omega_max)
        v, distance = _ramp(self.twist.v, v_goal, limits.alpha_v, dt)
        omega, angle = _ramp(self.twist.omega, omega_goal, limits.alpha_omega, dt)
        self.twist = Twist(v, omega)
        self.odometry = rolled(self.odometry, (distance, angle))
        return distance, angle


class Ride:
    """One episode's way through a world with all that moves in it."""

    def __init__(
        self,
        task: Task,
        robot: Robot,
        config: Disturbances,
        rng: np.random.Generator,
        crowd: Crowd,
        body: Body,
    ) -> None:
        self.crowd = crowd
        self.wheels = Wheels()
        self._body = body
        self._robot = robot
        self._track = track(robot.footprint)
        self._static = (np.ascontiguousarray(task.world.circles, dtype=np.float64), task.world.edges)
        self._goal, self._tolerance = np.asarray(task.goal, dtype=np.float64), task.goal_tolerance
        self._delay = Delay(config.latency)
        self._slip, self._rng = config.slip, rng
        self._time = 0.0

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) as they stand now."""
        circles, edges = self._static
        if not len(self.crowd):
            return circles, edges
        return np.vstack([circles, self.crowd.circles]), np.vstack([edges, self.crowd.edges])

    def start(self) -> State:
        """The state before the first command."""
        clearance, contact, arrived = self._verdict()
        travel = np.array([self._body.pose])
        return State(self._body.pose, self._body.twist, 0.0, travel, clearance, contact, arrived)

    def period(self, command: Twist, slices: int, limits: Callable[[Twist, Twist], Limits]) -> State:
        """One control period in equal slices; ends with the first slice that brings contact or arrival.

        A delayed command takes effect with the slice whose middle is past its time. limits: for a command
        and the twist of the wheels at the moment when it takes effect.
        """
        dt, least, travel = self._robot.dt / slices, math.inf, np.empty((slices, 3))
        factors = slip_factors(self._slip, self._rng)
        self._delay.send(command, self._time)
        obeyed: Twist | None = None
        for k in range(slices):
            told = self._delay.at(self._time + (k + 0.5) * dt)
            if told is not obeyed:
                obeyed, allowed = told, limits(told, self.wheels.twist)
            self.crowd.advance(self._body.pose, dt)
            self._body.move(slipped(self.wheels.turn(told, allowed, dt), factors, self._track), dt)
            travel[k] = self._body.pose
            clearance, contact, arrived = self._verdict()
            least = min(least, clearance)
            if contact or arrived:
                break
        self._time += dt * (k + 1)
        pose, twist = self._body.pose, self._body.twist
        return State(pose, twist, self._time, travel[: k + 1], least, contact, arrived)

    def _verdict(self) -> tuple[float, bool, bool]:
        """Clearance [m], contact, arrival; touching on arrival is contact."""
        pose, box = self._body.pose, self._robot.footprint.box
        here = np.array([pose])
        clearance, _ = sweep(here, box, *self._static)
        if len(self.crowd):
            clearance = min(clearance, sweep(here, box, self.crowd.circles, self.crowd.edges)[0])
        if self._body.touches(clearance):
            return 0.0, True, False
        away = math.hypot(pose.x - self._goal[0], pose.y - self._goal[1])
        return clearance, False, away <= self._tolerance


def track(footprint: Footprint) -> float:
    """Distance between the wheels [m]. ASSUMED: they stand at the sides of the footprint."""
    _, half_width, rounding = footprint.box
    return 2 * (half_width + rounding)


def rolled(pose: Pose, motion: tuple[float, float]) -> Pose:
    """The pose after a distance [m] along the middle heading of a turn [rad]."""
    distance, angle = motion
    return compose(pose, Pose(distance * math.cos(angle / 2), distance * math.sin(angle / 2), angle))


def _ramp(start: float, goal: float, rate: float, dt: float) -> tuple[float, float]:
    """Value after `dt` of a quantity that goes from start to goal at `rate` per second, and its integral."""
    change = goal - start
    ramp_time = min(abs(change) / rate, dt)
    end = goal if ramp_time < dt else start + math.copysign(rate * dt, change)
    return end, (start + end) / 2 * ramp_time + end * (dt - ramp_time)
