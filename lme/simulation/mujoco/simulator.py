"""Simulator of a Go2 that walks: its legs, not a footprint, touch the obstacles, and its lidar tilts with the trunk."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from lme.errors import InputError, argument_error, require
from lme.geometry.collision import sweep
from lme.geometry.frames import relative
from lme.inputs.plausibility import check_fields
from lme.robots import Robot
from lme.simulation.crowd import Crowd
from lme.simulation.disturbances import Delay, Disturbances
from lme.simulation.mujoco.arena import Arena, require_mujoco
from lme.simulation.mujoco.body import TIME_STEP
from lme.simulation.mujoco.lidar import TiltingLidar
from lme.simulation.mujoco.walker import Walker, standing_height
from lme.simulation.simulator import FALL, Attitude, LidarCloud, Sensors, State, forward_enough
from lme.simulation.substeps import nearby
from lme.types import Floats, Observation, Pose, Twist
from lme.worlds.world import Task

TWISTS = ("measured", "command", "zero")
PIECE = 4  # steps of the physics, 10 ms: resolution of latency, movers, arrival and the path
SLICE = 8  # steps of the physics, 20 ms, during which the lidar is taken to be where it is at their end
# Disturbances that the body and its gait make themselves.
_OWN = ("lag", "natural_frequency_v", "natural_frequency_omega", "ripple_v", "ripple_omega", "tilt", "slip")


@dataclass(slots=True)
class MujocoConfig(Disturbances):
    """What the robot reports, and the velocity loop in front of its gait."""

    twist: str
    twist_window: float
    registered: bool
    velocity_loop: bool

    def __post_init__(self) -> None:
        Disturbances.__post_init__(self)
        if self.twist not in TWISTS:
            raise argument_error(f"twist is {self.twist!r}: must be one of {', '.join(TWISTS)}")
        require("twist_window", self.twist_window, at_least=PIECE * TIME_STEP)
        for key in _OWN:
            if getattr(self, key) != 0.0:
                raise argument_error(
                    f"{key} is {getattr(self, key):g}: must be 0 in sim=mujoco, where the body has a gait of its own"
                )
        check_fields(self)


class MujocoSimulator:
    """Unitree Go2 among static and moving obstacles; any contact of a part with one, and a fall, ends the episode.

    The robot's footprint only gives the clearance. Its gait follows the commands as `Sensors.sent` limits them.
    """

    Config = MujocoConfig
    whole_clouds = False

    def __init__(self, config: MujocoConfig, robot: Robot) -> None:
        require_mujoco()
        if robot.lidar.cloud is None:
            raise InputError(
                f"robot.lidar.cloud is null in robot {robot.name}: sim=mujoco has the body of a Go2 with a 3D "
                "lidar, as in robot=go2"
            )
        self._config, self._robot, self._cloud_time = config, robot, robot.lidar.cloud.duration

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses, static ones first."""
        return self._crowd.among(*self._static)

    @property
    def people(self) -> tuple[Floats, Floats]:
        """See `lme.simulation.simulator.Simulator.people`."""
        return self._crowd.people

    def cloud(self) -> LidarCloud:
        """See `lme.simulation.simulator.Tilting`."""
        return self._lidar.cloud()

    def attitude(self) -> Attitude:
        """See `lme.simulation.simulator.Tilting`; the base frame is that of the trunk."""
        return Attitude(float(self._walker.trunk[2, 3]), *self._walker.tilt)

    def lidar_height(self) -> float:
        """See `lme.simulation.simulator.Tilting`."""
        assert self._robot.lidar.cloud is not None
        return self._robot.lidar.cloud.height - standing_height()

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, where it stands still."""
        config, robot = self._config, self._robot
        self._sensors = Sensors(robot, config, task, rng)
        self._lidar = TiltingLidar(
            robot.lidar, config.registered, self.whole_clouds, standing_height(), rng.spawn(1)[0]
        )
        self._delay = Delay(config.latency)
        self._start = Pose(*map(float, task.start))
        self._steps, self._periods = 0, 0  # of the physics, and of control
        self._enter(task)
        self._walker = Walker(self._arena, config.velocity_loop)
        self._walker.stand(self._start)
        self._poses = deque([(0.0, self._walker.pose)])
        self.state = self._state([self._walker.pose], [self._posture()])
        self._fire(self._cloud_time)
        return self._observe()

    def step(self, command: Twist) -> Observation:
        """Walk for one control period, or until contact, fall or arrival, whichever comes first."""
        self._sensors.sent(forward_enough(command, self._robot))
        self._delay.send(self._sensors.last_command, self._time)
        self._periods += 1
        end = round(self._periods * self._robot.dt / TIME_STEP)
        travel: list[Pose] = []
        postures: list[Floats] = []
        unseen = 0  # steps since the lidar fired
        while self._steps < end:
            # Movers first, then the robot, with the command that is active in the middle of the piece.
            steps = min(PIECE, end - self._steps)
            duration = steps * TIME_STEP
            self._crowd.advance(self._walker.pose, duration)
            made = self._walker.walk(self._delay.at(self._time + duration / 2), steps)
            self._steps += made
            pose = self._walker.pose
            travel.append(pose)
            postures.append(self._posture())
            self._poses.append((self._time, pose))
            if self._walker.contact or self._walker.has_fallen or self._is_at_goal(pose):
                break
            # The lidar, for as long before the next scan as a cloud takes.
            unseen = min(unseen + made, round(self._cloud_time / TIME_STEP) - (end - self._steps))
            if unseen >= SLICE:
                self._fire(unseen * TIME_STEP)
                unseen = 0
        if unseen > 0:
            self._fire(unseen * TIME_STEP)
        self.state = self._state(travel, postures)
        return self._observe()

    def change(self, task: Task) -> Observation:
        """See `lme.simulation.simulator.Changeable`."""
        former, walker = self._crowd, self._walker
        self._enter(task)
        self._crowd.go_on(former)
        self._sensors.change(task)
        self._walker = Walker(self._arena, self._config.velocity_loop)
        self._walker.go_on(walker)
        self.state = self._state([self._walker.pose], [self._posture()])
        self._fire(self._cloud_time)
        return self._observe()

    @property
    def _time(self) -> float:
        return self._steps * TIME_STEP

    def _enter(self, task: Task) -> None:
        """Take over the obstacles, movers and goal of a task."""
        self._task = task
        self._static = (np.ascontiguousarray(task.world.circles, dtype=np.float64), task.world.edges)
        self._crowd = Crowd(task.world.movers, task.world, self._robot.footprint.circumscribed_radius)
        self._arena = Arena(task.world, self._crowd)

    def _is_at_goal(self, pose: Pose) -> bool:
        return math.dist(pose[:2], self._task.goal) <= self._task.goal_tolerance

    def _posture(self) -> Floats:
        return np.concatenate(([self._time], self._walker.data.qpos))

    def _state(self, travel: list[Pose], postures: list[Floats]) -> State:
        """The state at the end of these poses and postures. Contact on arrival counts as contact only."""
        walker, poses, box = self._walker, np.array(travel), self._robot.footprint.box
        circles, edges = self.obstacles
        clearance, _ = sweep(poses, box, *nearby(self._task.world, poses, box, circles, edges))
        part = walker.contact or (FALL if walker.has_fallen else "")
        v, _, omega = walker.velocity.tolist()
        return State(
            pose=travel[-1],
            twist=Twist(v, omega),
            time=self._time,
            travel=poses,
            clearance=0.0 if part else clearance,
            contact=bool(part),
            arrived=not part and self._is_at_goal(travel[-1]),
            contact_part=part,
            legs=walker.legs,
            postures=np.array(postures),
        )

    def _fire(self, duration: float) -> None:
        self._lidar.fire(self._time, duration, self._walker.trunk, self._task.world, *self.obstacles)

    def _observe(self) -> Observation:
        pose = self.state.pose
        observation = self._sensors.observe(
            self.state,
            self._measured_twist(),
            relative(pose, self._start),
            *self.obstacles,
            self._crowd,
            ranges=self._lidar.ranges(pose),
        )
        if self._config.twist == "measured":
            return observation
        reported = self._sensors.last_command if self._config.twist == "command" else Twist(0.0, 0.0)
        return observation._replace(twist=reported)

    def _measured_twist(self) -> Twist:
        """Mean twist over the last `twist_window`, from the motion of the trunk."""
        poses = self._poses
        while len(poses) > 1 and poses[1][0] <= self._time - self._config.twist_window + 1e-9:
            poses.popleft()
        (begin, first), (end, last) = poses[0], poses[-1]
        if begin == end:
            return Twist(0.0, 0.0)
        moved = relative(last, first)
        return Twist(moved.x / (end - begin), moved.yaw / (end - begin))
