"""Simulators of a robot that slips: its wheels slide on the floor, and its odometry drifts."""

from __future__ import annotations

import math
import warnings
from dataclasses import asdict, dataclass
from typing import ClassVar, Protocol

import numpy as np

from lme.errors import InputError, argument_error, require
from lme.geometry.frames import compose, relative
from lme.geometry.skid import AXES, Chassis, WheelState, slide
from lme.inputs.plausibility import check_fields
from lme.robots import Drivetrain, Footprint, Response, Robot
from lme.simulation.crowd import Crowd
from lme.simulation.disturbances import Delay, Disturbances, slip_factors, slipped
from lme.simulation.gait import GaitResponse, check_height, response_of
from lme.simulation.simulator import Sensors, State, forward_enough
from lme.simulation.substeps import Wheels, rolled, track, until_event
from lme.types import Floats, Limits, Observation, Pose, Twist
from lme.worlds.world import Task

MAX_SUBSTEP = 0.01  # [s] resolution of latency, gait and movers
ODOMETRY_RATE = 50.0  # [Hz] of Jackal's odometry filter


@dataclass(slots=True)
class SkidConfig(Disturbances):
    """Directions of friction, errors of the sensors and resolution of the contact check."""

    friction: str
    yaw_noise: float
    scan_rate: float | None
    check_time: float

    def __post_init__(self) -> None:
        Disturbances.__post_init__(self)
        if self.friction not in AXES:
            raise argument_error(f"friction is {self.friction!r}: must be one of {', '.join(AXES)}")
        require("yaw_noise", self.yaw_noise, at_least=0.0)
        require("check_time", self.check_time, above=0.0)
        if self.scan_rate is not None:
            require("scan_rate", self.scan_rate, above=0.0)
        check_fields(self)


class SkidSimulator:
    """Base that slips among static and moving obstacles; any contact of the collision footprint ends the episode."""

    Config: ClassVar[type[SkidConfig]] = SkidConfig

    def __init__(self, config: SkidConfig, robot: Robot) -> None:
        check_base(robot)
        warn_of_differences(robot)
        check_height(config.tilt, robot)
        self._robot = robot
        self._config = config
        self._outline = outline_that_collides(robot)

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses, static ones first."""
        return self._crowd.among(*self._static)

    @property
    def people(self) -> tuple[Floats, Floats]:
        """See `lme.simulation.simulator.Simulator.people`."""
        return self._crowd.people

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, at rest."""
        config = self._config
        self._start = Pose(*map(float, task.start))
        self._enter(task)
        self._delay = Delay(config.latency)
        self._sensors = Sensors(self._robot, config, task, rng)
        self._slip_rng, self._yaw_rng, phase_rng = rng.spawn(3)
        self._scan_phase = phase_rng.uniform() / config.scan_rate if config.scan_rate else 0.0
        self._base, self._yaw_error = self._make_base(), 0.0
        self.state = self._state(np.array([self._start]), 0.0, 0.0)
        return self._observe()

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact or arrival, whichever comes first."""
        factors = slip_factors(self._config.slip, self._slip_rng)
        self._sensors.sent(command)
        begin, duration = self.state.time, self._robot.dt / self._pieces
        self._delay.send(forward_enough(command, self._robot), begin)
        states: list[State] = []
        for k in range(self._pieces):
            states.append(self._drive(begin + k * duration, duration, factors))
            if states[-1].contact or states[-1].arrived:
                break
        # The state at the end, with the poses and the least clearance of all pieces.
        travel = np.vstack([state.travel for state in states])
        self.state = states[-1]._replace(travel=travel, clearance=min(state.clearance for state in states))
        return self._observe()

    def change(self, task: Task) -> Observation:
        """See `lme.simulation.simulator.Changeable`."""
        former = self._crowd
        self._enter(task)
        self._crowd.go_on(former)
        self._sensors.change(task)
        self.state = self._state(np.array([self.state.pose]), self.state.time, 0.0)
        return self._observe()

    def _enter(self, task: Task) -> None:
        """Take over the obstacles, movers and goal of a task."""
        self._task = task
        self._static = (np.ascontiguousarray(task.world.circles, dtype=np.float64), task.world.edges)
        self._crowd = Crowd(task.world.movers, task.world, self._outline.circumscribed_radius)
        self._pieces = 1
        if len(self._crowd) or self._config.latency or self._config.has_gait:
            self._pieces = math.ceil(self._robot.dt / MAX_SUBSTEP - 1e-9)

    def _drive(self, time: float, duration: float, factors: tuple[float, float]) -> State:
        """Drive for a piece of a period, with the command that is active in its middle."""
        config, base = self._config, self._base
        count = math.ceil(duration / config.check_time - 1e-9)
        errors = self._yaw_rng.normal(0.0, config.yaw_noise, math.ceil(duration * ODOMETRY_RATE - 1e-9))
        # Movers first, then the base, as in `Substepper`.
        self._crowd.advance(base.pose, duration)
        poses = base.drive(self._delay.at(time + duration / 2), duration, count, factors, errors)
        self._yaw_error = float(errors[-1])
        return self._state(poses, time, duration)

    def _state(self, poses: Floats, time: float, duration: float) -> State:
        """The state at contact, at arrival or after the last of the poses, which took `duration` [s] from `time`."""
        box = self._outline.box
        travel, clearance, contact, arrived = until_event(poses, self._task, box, *self.obstacles)
        end = time + duration * len(travel) / len(poses)
        return State(Pose(*travel[-1].tolist()), self._base.twist, end, travel, clearance, contact, arrived)

    def _make_base(self) -> Base:
        robot, config = self._robot, self._config
        lag, gait = config.lag, response_of(config)
        if robot.response is not None:
            return RespondingBase(robot.response, robot.footprint, self._start, lag, gait)
        assert robot.drivetrain is not None
        return SlidingBase(robot.drivetrain, self._start, AXES.index(config.friction), lag, gait)

    def _observe(self) -> Observation:
        base, pose = self._base, self.state.pose
        measured = Pose(float(base.reckoned[0]), float(base.reckoned[1]), pose.yaw + self._yaw_error)
        odometry = relative(measured, self._start)
        return self._sensors.observe(
            self.state, base.measured, odometry, *self.obstacles, self._crowd, self._scan_pose()
        )

    def _scan_pose(self) -> Pose:
        """Pose at which the newest scan was taken, to the nearest pose of the last period."""
        travel, rate = self.state.travel, self._config.scan_rate
        if rate is None:
            return self.state.pose
        age = (self.state.time + self._scan_phase) % (1.0 / rate)
        num_back = round(age / self._config.check_time)
        return Pose(*travel[max(len(travel) - 1 - num_back, 0)].tolist())


@dataclass(slots=True)
class SpeedCap:
    """Highest speeds that systems command."""

    v_max: float  # [m/s]
    omega_max: float  # [rad/s]


@dataclass(slots=True)
class GazeboConfig(SkidConfig):
    """The skidding Jackal of the BARN Challenge, and what runs beside it in Gazebo.

    costmap_clocks: whether the systems' costmaps are rebuilt at rates of their own. cap: of systems that have none of
    their own. lab100_start: x, y [m] and yaw [rad] on this subset of BARN. The simulator does not use these three; the
    configs of systems and maps do.
    """

    costmap_clocks: bool
    cap: SpeedCap
    lab100_start: list[float]


class GazeboSimulator(SkidSimulator):
    """The BARN Challenge's Gazebo; see `conf/sim/gazebo.yaml`."""

    Config = GazeboConfig


def outline_that_collides(robot: Robot) -> Footprint:
    """Outline of the drivetrain if it has one, such as wheels that stand out; else the footprint."""
    return (robot.drivetrain and robot.drivetrain.contact) or robot.footprint


def check_base(robot: Robot) -> None:
    """Raise InputError if the robot has no drivetrain and no response, or if commands come too rarely."""
    drivetrain = robot.drivetrain
    if drivetrain is None and robot.response is None:
        raise InputError(
            f"robot.drivetrain is null in robot {robot.name}: sim=skid and sim=gazebo need mass, inertia, track, "
            "wheel_radius, friction and controller there, as conf/robot/jackal.yaml has them, or a robot.response"
        )
    if drivetrain is not None:
        check_control_rate(robot, drivetrain.controller.timeout)


def warn_of_differences(robot: Robot) -> None:
    """Warn if the outline that collides is smaller than the footprint, or if the wheels are slower than the limits."""
    drivetrain = robot.drivetrain
    if drivetrain is None:
        return
    if drivetrain.contact is not None:
        sides, outline = _sides(robot.footprint), _sides(drivetrain.contact)
        if any(side > limit + 1e-3 for side, limit in zip(sides, outline, strict=True)):
            warnings.warn(
                f"robot.footprint of {sides[0]:g} × {sides[1]:g} m reaches beyond robot.drivetrain.contact of "
                f"{outline[0]:g} × {outline[1]:g} m, the outline that collides: give both, or "
                "robot.drivetrain.contact=null for the footprint to collide",
                stacklevel=3,
            )
    for key in ("v_max", "omega_max"):
        limit, wheels = getattr(robot, key), getattr(drivetrain.controller, key)
        if limit > wheels:
            warnings.warn(
                f"robot.{key} is {limit:g}, robot.drivetrain.controller.{key} {wheels:g}: the robot gets no faster "
                "than the controller of its wheels allows",
                stacklevel=3,
            )


def _sides(outline: Footprint) -> tuple[float, float]:
    """Length and width of the rectangle around an outline [m]."""
    half_length, half_width, rounding = outline.box
    return 2.0 * (half_length + rounding), 2.0 * (half_width + rounding)


def check_control_rate(robot: Robot, timeout: float) -> None:
    """Raise InputError if commands come too rarely for wheels that stop after this time without one [s]."""
    if robot.dt > timeout:
        raise InputError(
            f"robot.control_rate is {robot.control_rate:g} Hz: must be at least {1 / timeout:g}, since the wheels stop "
            f"after {timeout:g} s without a command (robot.drivetrain.controller.timeout)"
        )


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
        controller, _, _ = (parameters.pop(key) for key in ("controller", "contact", "solid"))
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
