"""Kinematic simulator: exact geometry, no dynamics beyond velocity and acceleration limits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import relative
from lme.geometry.motion import drive, even_limits
from lme.inputs.plausibility import check_fields
from lme.robots import Robot
from lme.simulation.crowd import Crowd
from lme.simulation.disturbances import Disturbances
from lme.simulation.gait import check_height
from lme.simulation.simulator import Sensors, State, forward_enough
from lme.simulation.substeps import Body, Substepper, rolled, until_event
from lme.types import Floats, Limits, Observation, Pose, Twist
from lme.worlds.world import Task

MAX_SUBSTEP = 0.01  # [s] resolution of latency and lag


@dataclass(slots=True)
class FastConfig(Disturbances):
    """Resolution of the contact check, and how velocity follows the command."""

    max_step: float
    even_ramp: bool

    def __post_init__(self) -> None:
        Disturbances.__post_init__(self)
        require("max_step", self.max_step, above=0.0)
        check_fields(self)

    @property
    def needs_substeps(self) -> bool:
        """Return whether the motion has to be simulated in substeps, even without movers."""
        return bool(self.latency or self.lag or self.has_gait or self.slip)


class FastSimulator:
    """Differential drive with a footprint and a noisy lidar; any contact ends the episode.

    Without movers, slip, latency, lag and gait, a whole control period is checked at once; otherwise it is checked in
    substeps (`Substepper`).
    """

    Config = FastConfig

    def __init__(self, config: FastConfig, robot: Robot) -> None:
        check_height(config.tilt, robot)
        self._robot = robot
        self._box, self._reach, self._dt = (
            robot.footprint.box,
            robot.footprint.circumscribed_radius,
            robot.dt,
        )
        self._config = config

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses, static ones first."""
        return self._substepper.obstacles if self._substepper else (self._circles, self._edges)

    @property
    def people(self) -> tuple[Floats, Floats]:
        """See `lme.simulation.simulator.Simulator.people`."""
        return self._substepper.crowd.people if self._substepper else (np.empty((0, 3)), np.empty((0, 2)))

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, at rest."""
        self._enter(task)
        self._sensors = Sensors(self._robot, self._config, task, rng)
        self._start = Pose(*map(float, task.start))
        self._rng = rng
        crowd = Crowd(task.world.movers, task.world, self._robot.footprint.circumscribed_radius)
        self._substepper = self._make_substepper(task, crowd, _MasslessBody(self._start))
        if self._substepper:
            self.state = self._substepper.start()
        else:
            self.state = self._end_at_event(np.array([self._start]), Twist(0.0, 0.0), 0.0, 0.0)
        return self._observe()

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact or arrival, whichever comes first."""
        command = forward_enough(command, self._robot)
        if self._substepper:
            self._sensors.sent(command)
            self.state = self._substepper.period(command, self._substeps, self._limits)
            return self._observe()
        state = self.state
        limits = self._limits(command, state.twist)
        # Plain tuples: Numba takes a named one for another type, and needs longer to recognise it.
        motion = (*state.pose,), (*state.twist,), (*command,), limits.bounds
        travel, twist = drive(*motion, self._dt, self._config.max_step, self._reach)
        # Without delay the ramp itself is the command that the robot follows.
        self._sensors.last_command = Twist(*twist)
        self.state = self._end_at_event(travel, self._sensors.last_command, state.time, self._dt)
        return self._observe()

    def change(self, task: Task) -> Observation:
        """See `lme.simulation.simulator.Changeable`."""
        self._enter(task)
        self._sensors.change(task)
        crowd = Crowd(task.world.movers, task.world, self._robot.footprint.circumscribed_radius)
        if self._substepper is None:
            state = self.state
            body = _MasslessBody(state.pose, state.twist)
            self._substepper = self._make_substepper(task, crowd, body)
            if self._substepper is None:
                self.state = self._end_at_event(np.array([state.pose]), state.twist, state.time, 0.0)
                return self._observe()
            self._substepper.join(state, relative(state.pose, self._start))
        else:
            crowd.go_on(self._substepper.crowd)
            self._substepper.change(task, crowd)
            self._substeps = num_substeps(self._robot, self._config, crowd.top_speed)
        self.state = self._substepper.start()
        return self._observe()

    def _enter(self, task: Task) -> None:
        """Take over the obstacles and the goal of a task."""
        self._circles = np.ascontiguousarray(task.world.circles, dtype=np.float64)
        self._edges = task.world.edges
        self._task = task

    def _make_substepper(self, task: Task, crowd: Crowd, body: Body) -> Substepper | None:
        """Return a substepper if one is needed."""
        robot, config = self._robot, self._config
        if not (len(crowd) or config.needs_substeps):
            return None
        self._substeps = num_substeps(robot, config, crowd.top_speed)
        return Substepper(task, robot, config, self._rng.spawn(1)[0], crowd, body)

    def _limits(self, command: Twist, twist: Twist) -> Limits:
        """Return the limits; for an even ramp, α is lowered so that velocity changes over the whole period."""
        limits = self._robot.limits
        if not self._config.even_ramp:
            return limits
        return Limits(*even_limits(twist, command, limits.bounds, self._robot.dt))

    def _end_at_event(self, travel: Floats, twist: Twist, start_time: float, dt: float) -> State:
        """Cut the motion at contact or arrival."""
        obstacles = (self._circles, self._edges)
        driven, clearance, contact, arrived = until_event(travel, self._task, self._box, *obstacles)
        time = start_time + dt * len(driven) / len(travel)
        return State(Pose(*driven[-1].tolist()), twist, time, driven, clearance, contact, arrived)

    def _observe(self) -> Observation:
        state = self.state
        if self._substepper:
            wheels, crowd = self._substepper.wheels, self._substepper.crowd
            return self._sensors.observe(state, wheels.twist, wheels.odometry, *self.obstacles, crowd)
        odometry = relative(state.pose, self._start)
        return self._sensors.observe(state, state.twist, odometry, self._circles, self._edges)


def num_substeps(robot: Robot, config: FastConfig, fastest_mover: float = 0.0) -> int:
    """Number of substeps of a period, so that robot and movers at top speed move at most `max_step` together."""
    v_max = (1.0 + config.overshoot_v) * robot.v_max
    omega_max = (1.0 + config.overshoot_omega) * robot.omega_max
    fastest = v_max + robot.footprint.circumscribed_radius * omega_max + fastest_mover
    return math.ceil(max(fastest * robot.dt / config.max_step, robot.dt / MAX_SUBSTEP) - 1e-9)


class _MasslessBody:
    """A body that moves exactly as its wheels roll."""

    def __init__(self, pose: Pose, twist: Twist = Twist(0.0, 0.0)) -> None:  # noqa: B008 - it is a tuple
        self.pose = pose
        self.twist = twist

    def move(self, motion: tuple[float, float], dt: float) -> None:
        """Roll by a distance [m] and a turn [rad]."""
        self.pose = rolled(self.pose, motion)
        self.twist = Twist(motion[0] / dt, motion[1] / dt)

    def touches(self, clearance: float) -> bool:
        """Return whether the distance is 0."""
        return clearance <= 0.0
