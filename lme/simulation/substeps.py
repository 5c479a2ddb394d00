"""Motion until contact or arrival, also in short substeps, which delay, lag, gait, slip, movers and bodies need."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from lme.geometry.collision import first_event, sweep
from lme.geometry.frames import compose
from lme.grids.edge_grid import near_edges
from lme.grids.leaves import near_discs
from lme.robots import Footprint, Robot
from lme.simulation.crowd import Crowd
from lme.simulation.disturbances import Delay, Disturbances, slip_factors, slipped
from lme.simulation.gait import GaitResponse, response_of
from lme.simulation.simulator import State
from lme.types import Floats, Limits, Pose, Twist
from lme.worlds.world import MANY, Task, World


class Body(Protocol):
    """Body of the robot, which the wheels move and which owns the pose."""

    pose: Pose
    twist: Twist  # over ground

    def move(self, motion: tuple[float, float], dt: float) -> None:
        """Roll by a distance [m] and a turn [rad] within `dt` [s]. The movers have already moved for dt."""

    def touches(self, clearance: float) -> bool:
        """Return whether the body is in contact; `clearance`: distance from the footprint to the obstacles [m]."""


class Wheels:
    """Two driven wheels that follow commands within the limits, with encoders.

    ramped: current velocities on the ramps. twist: of the tread; the same unless there is a response. odometry: pose
    of the base according to the encoders, in the frame of the start.
    """

    def __init__(self, lag: float = 0.0, response: GaitResponse | None = None) -> None:
        """lag: time constant with which the velocities approach the command, within the limits [s].

        response: that of legs, which take the place of the wheels and follow the ramps.
        """
        self._lag = lag
        self._response = response
        self.ramped = self.twist = Twist(0.0, 0.0)
        self.odometry = Pose(0.0, 0.0, 0.0)

    def turn(self, command: Twist, limits: Limits, dt: float) -> tuple[float, float]:
        """Distance [m] and turn [rad] of the tread in `dt` [s]. Each velocity ramps at its own limit."""
        v_goal = min(max(command.v, -limits.v_max), limits.v_max)
        omega_goal = min(max(command.omega, -limits.omega_max), limits.omega_max)
        if self._lag:
            decay = math.exp(-dt / self._lag)
            v_goal += decay * (self.ramped.v - v_goal)
            omega_goal += decay * (self.ramped.omega - omega_goal)
        v, distance = _ramp(self.ramped.v, v_goal, limits.alpha_v, dt)
        omega, angle = _ramp(self.ramped.omega, omega_goal, limits.alpha_omega, dt)
        self.ramped = self.twist = Twist(v, omega)
        if self._response:
            distance, angle = self._response.follow((distance / dt, angle / dt), dt)
            self.twist = self._response.twist
        self.odometry = rolled(self.odometry, (distance, angle))
        return distance, angle


class Substepper:
    """Moves robot and movers through one episode, substep by substep."""

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
        self.wheels = Wheels(config.lag, response_of(config))
        self._body = body
        self._robot = robot
        self._track = track(robot.footprint)
        self._enter(task)
        self._delay = Delay(config.latency)
        self._slip, self._rng = config.slip, rng
        self._time = 0.0

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses."""
        return self.crowd.among(*self._static)

    def start(self) -> State:
        """Return the state before the next command."""
        clearance, contact, arrived = self._check()
        travel = np.array([self._body.pose])
        return State(self._body.pose, self._body.twist, self._time, travel, clearance, contact, arrived)

    def change(self, task: Task, crowd: Crowd, body: Body | None = None) -> None:
        """Continue among the obstacles and movers of another task. body: replaces the current one; None: keep it."""
        self._enter(task)
        self.crowd = crowd
        self._body = body or self._body

    def join(self, state: State, odometry: Pose) -> None:
        """Continue from a state that was reached without substeps."""
        self._time = state.time
        self.wheels.ramped = self.wheels.twist = state.twist
        self.wheels.odometry = odometry

    def _enter(self, task: Task) -> None:
        self._world = task.world
        self._static = (np.ascontiguousarray(task.world.circles, dtype=np.float64), task.world.edges)
        self._goal, self._tolerance = np.asarray(task.goal, dtype=np.float64), task.goal_tolerance

    def period(self, command: Twist, substeps: int, limits: Callable[[Twist, Twist], Limits]) -> State:
        """Simulate one control period in equal substeps, or until the first contact or arrival.

        A delayed command takes effect in the first substep whose middle is at or past its time.
        limits: function of a command and of the velocities on the ramps when it takes effect.
        """
        dt, min_clearance, travel = self._robot.dt / substeps, math.inf, np.empty((substeps, 3))
        factors = slip_factors(self._slip, self._rng)
        self._delay.send(command, self._time)
        previous: Twist | None = None
        for k in range(substeps):
            # The command that is active in the middle of the substep, and its limits from when it took effect.
            active = self._delay.at(self._time + (k + 0.5) * dt)
            if active is not previous:
                previous, allowed = active, limits(active, self.wheels.ramped)
            # Movers first, then the robot, whose wheels may slip.
            self.crowd.advance(self._body.pose, dt)
            self._body.move(slipped(self.wheels.turn(active, allowed, dt), factors, self._track), dt)
            travel[k] = self._body.pose
            clearance, contact, arrived = self._check()
            min_clearance = min(min_clearance, clearance)
            if contact or arrived:
                break
        self._time += dt * (k + 1)
        pose, twist = self._body.pose, self._body.twist
        return State(pose, twist, self._time, travel[: k + 1], min_clearance, contact, arrived)

    def _check(self) -> tuple[float, bool, bool]:
        """Return clearance [m], contact and arrival. Contact on arrival counts as contact only."""
        pose, box = self._body.pose, self._robot.footprint.box
        poses = np.array([pose])
        circles, edges = self._static
        clearance, _ = sweep(poses, box, *nearby(self._world, poses, box, circles, edges))
        if len(self.crowd):
            clearance = min(clearance, sweep(poses, box, self.crowd.circles, self.crowd.edges)[0])
        if self._body.touches(clearance):
            return 0.0, True, False
        distance = math.hypot(pose.x - self._goal[0], pose.y - self._goal[1])
        return clearance, False, distance <= self._tolerance


def until_event(
    travel: Floats, task: Task, box: tuple[float, float, float], circles: Floats, edges: Floats
) -> tuple[Floats, float, bool, bool]:
    """Return the poses up to contact or arrival, least clearance [m], contact, arrival.

    travel (K, 3); box: the collision footprint; circles (C, 3) and edges (E, 4), those of the task's world first.
    Contact on arrival counts as contact only.
    """
    circles, edges = nearby(task.world, travel, box, circles, edges)
    goal = np.asarray(task.goal, dtype=np.float64)
    driven, clearance, contact, arrived = first_event(
        travel, goal, float(task.goal_tolerance), box, circles, edges
    )
    return travel[:driven], clearance, contact, arrived


def nearby(
    world: World, poses: Floats, box: tuple[float, float, float], circles: Floats, edges: Floats
) -> tuple[Floats, Floats]:
    """Drop circles and edges that are too far away to be the nearest to a motion; all stay where they are few.

    circles (C, 3), edges (E, 4): the world's come first. poses (K, 3) and box (half_length, half_width, rounding) [m]
    of the footprint.
    """
    if len(world.circles) >= MANY:
        circles = _joined(near_discs(world.discs, poses, box), circles[len(world.circles) :])
    if len(world.grid.edges):
        edges = _joined(near_edges(world.grid, poses, box), edges[len(world.edges) :])
    return circles, edges


def _joined(static: Floats, moving: Floats) -> Floats:
    return np.vstack([static, moving]) if len(moving) else static


def track(footprint: Footprint) -> float:
    """Distance between the wheels [m]. ASSUMED: the wheels are at the sides of the footprint."""
    _, half_width, rounding = footprint.box
    return 2 * (half_width + rounding)


def rolled(pose: Pose, motion: tuple[float, float]) -> Pose:
    """Return the pose after a turn [rad] and a distance [m] along the middle heading of the turn."""
    distance, angle = motion
    return compose(pose, Pose(distance * math.cos(angle / 2), distance * math.sin(angle / 2), angle))


def _ramp(start: float, goal: float, rate: float, dt: float) -> tuple[float, float]:
    """Value after `dt` of a quantity that ramps from start to goal at `rate` per second, and its integral."""
    change = goal - start
    ramp_time = min(abs(change) / rate, dt)
    end = goal if ramp_time < dt else start + math.copysign(rate * dt, change)
    return end, (start + end) / 2 * ramp_time + end * (dt - ramp_time)
