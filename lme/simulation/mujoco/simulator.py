"""Simulator of robots with bodies: legs or wheels, not a footprint, touch the obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError, argument_error, require
from lme.geometry.collision import sweep
from lme.geometry.skid import AXES
from lme.inputs.plausibility import check_fields
from lme.robots import Robot
from lme.simulation.crowd import Crowd
from lme.simulation.disturbances import Delay, Disturbances
from lme.simulation.mujoco.arena import require_mujoco
from lme.simulation.mujoco.legs import Legs
from lme.simulation.mujoco.machine import Machine
from lme.simulation.mujoco.wheels import FourWheels, check_wheels
from lme.simulation.simulator import Sensors, State, Tilting, forward_enough
from lme.simulation.skid.simulator import outline_that_collides
from lme.simulation.substeps import nearby
from lme.types import Floats, Observation, Pose, Twist
from lme.worlds.world import Task

TWISTS = ("measured", "command", "zero")
LEAST_WINDOW = 0.01  # [s] between two poses of a walking robot
# Disturbances that bodies make themselves.
_OWN = ("lag", "natural_frequency_v", "natural_frequency_omega", "ripple_v", "ripple_omega", "tilt", "slip")


@dataclass(slots=True)
class MujocoConfig(Disturbances):
    """What the robot reports; on legs: of its cloud, and the velocity loop; on wheels: as in `SkidConfig`."""

    twist: str
    twist_window: float
    registered: bool
    velocity_loop: bool
    friction: str
    yaw_noise: float
    scan_rate: float | None

    def __post_init__(self) -> None:
        Disturbances.__post_init__(self)
        for key, words in (("twist", TWISTS), ("friction", AXES)):
            if getattr(self, key) not in words:
                raise argument_error(f"{key} is {getattr(self, key)!r}: must be one of {', '.join(words)}")
        require("twist_window", self.twist_window, at_least=LEAST_WINDOW)
        require("yaw_noise", self.yaw_noise, at_least=0.0)
        if self.scan_rate is not None:
            require("scan_rate", self.scan_rate, above=0.0)
        for key in _OWN:
            if getattr(self, key) != 0.0:
                raise argument_error(
                    f"{key} is {getattr(self, key):g}: must be 0 in sim=mujoco, whose bodies move by their own dynamics"
                )
        check_fields(self)


class MujocoSimulator:
    """A Go2 on legs or a robot on four wheels among static and moving obstacles.

    Any contact of a part with an obstacle, and a fall, ends the episode. The outline only gives the clearance.
    """

    Config = MujocoConfig

    def __init__(self, config: MujocoConfig, robot: Robot) -> None:
        require_mujoco()
        self._config, self._robot = config, robot
        self._outline = outline_that_collides(robot)
        self._machine = _machine(config, robot)

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses, static ones first."""
        return self._crowd.among(*self._static)

    @property
    def people(self) -> tuple[Floats, Floats]:
        """See `lme.simulation.simulator.Simulator.people`."""
        return self._crowd.people

    @property
    def tilting(self) -> Tilting | None:
        """See `lme.simulation.simulator.tilting_of`."""
        return self._machine if isinstance(self._machine, Legs) else None

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, where it stands still."""
        self._sensors = Sensors(self._robot, self._config, task, rng)
        self._machine.begin(Pose(*map(float, task.start)), rng.spawn(1)[0])
        self._delay = Delay(self._config.latency)
        self._steps, self._periods = 0, 0  # of the physics, and of control
        self._enter(task)
        self._machine.enter(task.world, self._crowd)
        self.state = self._state([self._machine.pose], self._posture())
        return self._observe()

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact, fall or arrival, whichever comes first."""
        machine = self._machine
        command = forward_enough(command, self._robot)
        self._sensors.sent(command)
        # Legs follow commands as the limits allow them; wheels have a controller of their own.
        self._delay.send(self._sensors.last_command if isinstance(machine, Legs) else command, self._time)
        self._periods += 1
        end = round(self._periods * self._robot.dt / machine.time_step)
        travel: list[Pose] = []
        postures: list[Floats] = []
        while self._steps < end:
            # Movers first, then the robot, with the command that is active in the middle of the piece.
            steps = min(machine.piece, end - self._steps)
            duration = steps * machine.time_step
            self._crowd.advance(machine.pose, duration)
            made = machine.move(self._delay.at(self._time + duration / 2), steps)
            self._steps += made
            travel.append(machine.pose)
            postures += self._posture()
            if machine.contact or self._is_at_goal(travel[-1]):
                break
            machine.look(self._time, made, end - self._steps, *self.obstacles)
        self.state = self._state(travel, postures)
        return self._observe()

    def change(self, task: Task) -> Observation:
        """See `lme.simulation.simulator.Changeable`."""
        former = self._crowd
        self._enter(task)
        self._crowd.go_on(former)
        self._sensors.change(task)
        self._machine.enter(task.world, self._crowd)
        self.state = self._state([self._machine.pose], self._posture())
        return self._observe()

    @property
    def _time(self) -> float:
        return self._steps * self._machine.time_step

    def _enter(self, task: Task) -> None:
        """Take over the obstacles, movers and goal of a task."""
        self._task = task
        self._static = (np.ascontiguousarray(task.world.circles, dtype=np.float64), task.world.edges)
        self._crowd = Crowd(task.world.movers, task.world, self._outline.circumscribed_radius)

    def _is_at_goal(self, pose: Pose) -> bool:
        return math.dist(pose[:2], self._task.goal) <= self._task.goal_tolerance

    def _posture(self) -> list[Floats]:
        """Time and joints, for `State.postures`; [] on wheels."""
        joints = self._machine.joints
        return [] if joints is None else [np.concatenate(([self._time], joints))]

    def _state(self, travel: list[Pose], postures: list[Floats]) -> State:
        """The state at the end of these poses and postures. Contact on arrival counts as contact only."""
        machine, poses, box = self._machine, np.array(travel), self._outline.box
        circles, edges = self.obstacles
        clearance, _ = sweep(poses, box, *nearby(self._task.world, poses, box, circles, edges))
        part = machine.contact
        v, _, omega = machine.velocity.tolist()
        return State(
            pose=travel[-1],
            twist=Twist(v, omega),
            time=self._time,
            travel=poses,
            clearance=0.0 if part else clearance,
            contact=bool(part),
            arrived=not part and self._is_at_goal(travel[-1]),
            contact_part=part,
            legs=machine.legs,
            postures=np.array(postures) if postures else None,
        )

    def _observe(self) -> Observation:
        readings = self._machine.read(self.state, *self.obstacles)
        observation = self._sensors.observe(
            self.state,
            readings.twist,
            readings.odometry,
            *self.obstacles,
            self._crowd,
            readings.scan_pose,
            readings.ranges,
        )
        if self._config.twist == "measured":
            return observation
        reported = self._sensors.last_command if self._config.twist == "command" else Twist(0.0, 0.0)
        return observation._replace(twist=reported)


def _machine(config: MujocoConfig, robot: Robot) -> Machine:
    """The body that MuJoCo has of a robot; raise InputError if it has none."""
    if robot.drivetrain is not None:
        check_wheels(robot, robot.drivetrain)
        return FourWheels(robot, config.friction, config.yaw_noise, config.scan_rate)
    if robot.lidar.cloud is None:
        raise InputError(
            f"robot.lidar.cloud is null in robot {robot.name}: sim=mujoco has the body of a Go2 with a 3D lidar, as in "
            "robot=go2, and that of a robot on four wheels with a robot.drivetrain, as in robot=jackal"
        )
    return Legs(robot, config.registered, config.velocity_loop, config.twist_window)
