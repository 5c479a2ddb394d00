"""A Go2 on its legs, with a Mid-360 that takes its cloud while the trunk moves and tilts."""

from __future__ import annotations

from collections import deque

import numpy as np

from lme.geometry.frames import relative
from lme.robots import Robot
from lme.simulation.crowd import Crowd
from lme.simulation.mujoco.arena import Arena
from lme.simulation.mujoco.body import TIME_STEP, add_robot
from lme.simulation.mujoco.lidar import TiltingLidar
from lme.simulation.mujoco.machine import Readings
from lme.simulation.mujoco.walker import Walker, standing_height
from lme.simulation.simulator import FALL, Attitude, LidarCloud, State
from lme.types import Floats, Pose, Twist
from lme.worlds.world import World

PIECE = 4  # steps, 10 ms
SLICE = 8  # steps, 20 ms, during which the lidar is taken to be where it is at their end


class Legs:
    """See `Machine`, and `lme.simulation.simulator.Tilting`."""

    time_step, piece = TIME_STEP, PIECE

    def __init__(self, robot: Robot, registered: bool, velocity_loop: bool, twist_window: float) -> None:
        """registered: see `TiltingLidar`. twist_window: over which the measured twist is averaged [s]."""
        assert robot.lidar.cloud is not None
        self._lidar_mount, self._cloud_time = robot.lidar, robot.lidar.cloud.duration
        self._registered, self._velocity_loop, self._twist_window = registered, velocity_loop, twist_window
        self.whole_clouds = False

    def begin(self, start: Pose, rng: np.random.Generator) -> None:
        """See `Machine`."""
        self._start, self._steps = start, 0
        self._lidar = TiltingLidar(
            self._lidar_mount, self._registered, self.whole_clouds, standing_height(), rng
        )
        self._walker: Walker | None = None
        self._poses = deque([(0.0, start)])

    def enter(self, world: World, crowd: Crowd) -> None:
        """See `Machine`."""
        former, self._world = self._walker, world
        self._walker = Walker(Arena(world, crowd, add_robot), self._velocity_loop)
        if former is None:
            self._walker.stand(self._start)
            self._poses[0] = 0.0, self._walker.pose
        else:
            self._walker.go_on(former)
        self._unseen = round(self._cloud_time / TIME_STEP)  # steps since the lidar fired: a whole cloud

    def move(self, command: Twist, steps: int) -> int:
        """See `Machine`."""
        made = self._body.walk(command, steps)
        self._steps += made
        self._poses.append((self._steps * TIME_STEP, self.pose))
        return made

    def look(self, time: float, made: int, left: int, circles: Floats, edges: Floats) -> None:
        """See `Machine`. The lidar fires for as long before the next scan as a cloud takes."""
        self._unseen = min(self._unseen + made, round(self._cloud_time / TIME_STEP) - left)
        if self._unseen >= SLICE:
            self._fire(time, circles, edges)

    def read(self, state: State, circles: Floats, edges: Floats) -> Readings:
        """See `Machine`. The twist is the mean over its window; the odometry, as from FAST-LIO, is exact."""
        if self._unseen > 0:
            self._fire(state.time, circles, edges)
        return Readings(
            self._twist(), relative(state.pose, self._start), None, self._lidar.ranges(state.pose)
        )

    @property
    def contact(self) -> str:
        """See `Machine`."""
        return self._body.contact or (FALL if self._body.has_fallen else "")

    @property
    def pose(self) -> Pose:
        """See `Machine`."""
        return self._body.pose

    @property
    def velocity(self) -> Floats:
        """See `Machine`."""
        return self._body.velocity

    @property
    def legs(self) -> Floats:
        """See `Machine`."""
        return self._body.legs

    @property
    def joints(self) -> Floats:
        """See `Machine`."""
        joints: Floats = self._body.data.qpos
        return joints

    def cloud(self) -> LidarCloud:
        """See `Tilting`."""
        return self._lidar.cloud()

    def attitude(self) -> Attitude:
        """See `Tilting`; the base frame is that of the trunk."""
        return Attitude(float(self._body.trunk[2, 3]), *self._body.tilt)

    def lidar_height(self) -> float:
        """See `Tilting`."""
        assert self._lidar_mount.cloud is not None
        return self._lidar_mount.cloud.height - standing_height()

    @property
    def _body(self) -> Walker:
        assert self._walker is not None
        return self._walker

    def _fire(self, time: float, circles: Floats, edges: Floats) -> None:
        self._lidar.fire(time, self._unseen * TIME_STEP, self._body.trunk, self._world, circles, edges)
        self._unseen = 0

    def _twist(self) -> Twist:
        """Mean twist over the last `twist_window`, from the motion of the trunk."""
        poses, time = self._poses, self._steps * TIME_STEP
        while len(poses) > 1 and poses[1][0] <= time - self._twist_window + 1e-9:
            poses.popleft()
        (begin, first), (end, last) = poses[0], poses[-1]
        if begin == end:
            return Twist(0.0, 0.0)
        moved = relative(last, first)
        return Twist(moved.x / (end - begin), moved.yaw / (end - begin))
