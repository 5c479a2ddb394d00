"""Interface of every simulator, and the robot's sensors, which all simulators share."""

from __future__ import annotations

from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from lme.geometry.frames import compose, relative
from lme.grids.leaves import NO_WALLS
from lme.perception.raycast import add_noise, cast_grid, cast_leaves, cast_shapes
from lme.perception.resampling import resampled, tidied
from lme.perception.shadows import without_shadows
from lme.robots import Robot, reachable
from lme.simulation.crowd import Crowd, tracked
from lme.simulation.disturbances import (
    Disturbances,
    Measured,
    Odometry,
    PastMotion,
    TargetEstimate,
    lose_beams,
)
from lme.simulation.gait import floor_ranges, is_walking, rippled
from lme.simulation.mid360 import mid360_of
from lme.types import Floats, LaserScan, Observation, Pose, Twist
from lme.worlds.world import Task

FALL = "fall"  # in place of a part: the robot fell, which counts as contact


class State(NamedTuple):
    """The true state after a reset or a step.

    time: since reset [s]. travel: (K, 3) poses passed in the last period; the last one is `pose`.
    clearance: least distance from footprint to obstacle over the period [m]; 0 in contact. contact_part: the part of a
    robot with a body that is in contact, or `FALL` if it fell: trunk, thigh, calf or foot on legs, chassis or wheel on
    wheels; empty in simulators that know no parts. legs: hip, knee and foot of each leg from above, (L, 3, 2) in the
    frame of `pose` [m]; None for other robots. postures: (K, 1 + Q) time [s] and MuJoCo's coordinates of body and
    joints of a robot on legs at each pose of `travel`; None for other robots.
    """

    pose: Pose
    twist: Twist
    time: float
    travel: Floats
    clearance: float
    contact: bool
    arrived: bool
    contact_part: str = ""
    legs: Floats | None = None
    postures: Floats | None = None


class Simulator(Protocol):
    """A robot in a world. `state` is the true state, which no guide or planner sees."""

    state: State

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses, static ones first."""

    @property
    def people(self) -> tuple[Floats, Floats]:
        """Moving discs that are present: circles (P, 3) and velocities (P, 2), in the world [m, m/s]."""

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, at rest."""

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact or arrival, whichever comes first."""


@runtime_checkable
class Changeable(Protocol):
    """Simulator whose world can change while the robot drives. All simulators of lme allow it."""

    def change(self, task: Task) -> Observation:
        """Continue among the obstacles of another task and to its goal, from the current pose; its start is not used.

        Movers that were in the last task too, as the same objects, continue from where they are.
        """


class LidarCloud(NamedTuple):
    """One cloud of a 3D lidar. points (N, 3): in the lidar's frame [m].

    times (N,): when each was measured, counted from the end of the cloud, so at most 0 [s]; None if all of them are
    where they would be at its end, as in the cloud of lidar-inertial odometry.
    """

    points: Floats
    times: Floats | None


class Attitude(NamedTuple):
    """What a planar pose leaves out: height of the base frame above the floor [m], its roll and its pitch [rad]."""

    height: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0


class Tilting(Protocol):
    """Part of a simulator: a body that tilts and carries a 3D lidar.

    whole_clouds: whether clouds also have the points above everything that counts for a scan; set it before `reset`.
    """

    whole_clouds: bool

    def cloud(self) -> LidarCloud:
        """Return the newest cloud."""

    def attitude(self) -> Attitude:
        """Return the attitude of the base frame, which is fixed to the body, at the pose of `state`."""

    def lidar_height(self) -> float:
        """Return how far the lidar is above the origin of the base frame [m]."""


def tilting_of(simulator: Simulator) -> Tilting | None:
    """Return the body of a simulated robot that tilts and carries a 3D lidar; None for other robots."""
    tilting: Tilting | None = getattr(simulator, "tilting", None)
    return tilting


def forward_enough(command: Twist, robot: Robot) -> Twist:
    """Return the command, limited to backing up no faster than v_min."""
    return command if robot.v_min is None else Twist(max(command.v, robot.v_min), command.omega)


class Sensors:
    """Lidar, wheel encoders and localisation of a robot, with the configured disturbances."""

    def __init__(self, robot: Robot, config: Disturbances, task: Task, rng: np.random.Generator) -> None:
        """`rng` gives the lidar's own noise; the disturbances draw from streams spawned from it."""
        self._robot = robot
        self._limits = robot.limits
        self._config = config
        self._rng = rng
        self._scan_rng, goal_rng = rng.spawn(2)
        odometry_rng, self._ripple_rng, self._tilt_rng = goal_rng.spawn(3)
        self._odometry = Odometry(config.odometry_error, odometry_rng)
        self._past = PastMotion(config.odometry_age)
        self._target = TargetEstimate(config, np.asarray(task.goal, dtype=np.float64), goal_rng)
        self._look_in(task)
        self.last_command = Twist(0.0, 0.0)
        self._fired, self._mount = robot.lidar.native, robot.lidar.mount
        self._mid360 = mid360_of(robot.lidar) if robot.lidar.cloud else None
        if self._mid360:
            self._mid360.reset(rng)

    def sent(self, command: Twist) -> None:
        """Remember the command of a period, as far as the robot's limits allow it after the last one."""
        self.last_command = reachable(*command, self.last_command, self._limits, self._robot.dt)

    def change(self, task: Task) -> None:
        """Observe the obstacles and the goal of another task from now on."""
        self._look_in(task)
        self._target.aim(np.asarray(task.goal, dtype=np.float64))

    def observe(
        self,
        state: State,
        twist: Twist,
        odometry: Pose,
        circles: Floats,
        edges: Floats,
        crowd: Crowd | None = None,
        scan_pose: Pose | None = None,
        ranges: NDArray[np.float32] | None = None,
    ) -> Observation:
        """Return the observation. twist, odometry: those of exact encoders.

        circles (C, 3), edges (E, 4): the current obstacles, static ones first; crowd: the movers among them.
        scan_pose: where the newest scan was taken, if not at the current pose. ranges (num_beams,): of that scan [m],
        with the lidar's own noise, if the simulator makes it itself.
        """
        scan_pose = scan_pose or state.pose
        config, walking = self._config, is_walking(twist)
        scan = self._scan(scan_pose, circles, edges, config.tilt if walking else 0.0, ranges)
        # Twist and odometry as measured: with the ripple of the gait, and the errors of the encoders.
        if walking and (config.ripple_v or config.ripple_omega):
            twist = rippled(twist, config.ripple_v, config.ripple_omega, self._ripple_rng)
        current = Measured(state.pose, *self._odometry.measured(twist, odometry))
        # Odometry and localisation report the motion some time ago, the scan its own pose.
        delayed = self._past.at(state.time, current)
        target = self._target.seen_from(delayed.pose, delayed.odometry, state.time)
        scanned_at = compose(current.odometry, relative(scan_pose, current.pose))
        observation = Observation(
            scan,
            target,
            delayed.twist,
            self._limits,
            delayed.odometry,
            scan_pose=scanned_at,
            last_command=self.last_command,
        )
        # People come from the tracker, whose view is that of the scan.
        if crowd is None or not len(crowd):
            return observation
        lidar = compose(scan_pose, self._mount)
        return observation._replace(pedestrians=tracked(crowd, scan, lidar, state.pose))

    def _look_in(self, task: Task) -> None:
        self._world = task.world

    def _scan(
        self,
        pose: Pose,
        circles: Floats,
        edges: Floats,
        tilt: float,
        ranges: NDArray[np.float32] | None,
    ) -> LaserScan:
        """Return a planar scanner's beams, interpolated and filtered as the robot says, or a cloud's projection.

        tilt: standard deviation of the pitch [rad], which a levelled cloud does not have. ranges: None: cast here.
        """
        lidar, fired, config = self._robot.lidar, self._fired, self._config
        # Exact ranges: the projection of a cloud, or the beams of a planar lidar, which may meet the floor.
        if ranges is not None:
            sensor_noise = 0.0
        elif self._mid360:
            grid = self._world.grid
            moving_edges = edges[len(self._world.edges) if len(grid.edges) else 0 :]
            ranges, sensor_noise = self._mid360.scan(lidar, pose, circles, moving_edges, grid), 0.0
        else:
            angles = (fired.angle_min, fired.angle_increment, fired.num_beams)
            ranges = self._cast(compose(pose, self._mount), angles, circles, edges)
            if tilt > 0.0:
                assert lidar.height is not None
                beams = np.arange(fired.num_beams, dtype=np.float64)
                bearings = self._mount.yaw + fired.angle_min + fired.angle_increment * beams
                floor = floor_ranges(bearings, lidar.height, tilt, self._tilt_rng)
                ranges = np.minimum(ranges, floor, dtype=np.float32)
            sensor_noise = lidar.noise_std
        # Noise of the lidar itself, noise that was configured, and lost beams.
        for std, rng in ((sensor_noise, self._rng), (config.scan_noise, self._scan_rng)):
            if std > 0.0:
                noise = rng.standard_normal(fired.num_beams, dtype=np.float32)
                add_noise(ranges, noise, std, lidar.range_max)
        if config.scan_dropout > 0.0:
            lose_beams(ranges, config.scan_dropout, lidar.range_max, self._scan_rng)
        scan = LaserScan(ranges, fired.angle_min, fired.angle_increment, lidar.range_min, lidar.range_max)
        if fired is not lidar:
            scan = resampled(tidied(scan), self._mount, lidar)
        return scan if lidar.shadow_angle is None else without_shadows(scan, lidar.shadow_angle)

    def _cast(
        self, lidar: Pose, angles: tuple[float, float, int], circles: Floats, edges: Floats
    ) -> NDArray[np.float32]:
        """Cast the beams. circles, edges: the current obstacles, those of the world first."""
        range_max, world = self._robot.lidar.range_max, self._world
        # The static obstacles, by leaf or grid, then those that move.
        if not len(world.grid.edges):
            ranges = cast_leaves(lidar, angles, range_max, world.discs, world.walls)
        else:
            ranges = cast_grid(lidar, angles, range_max, world.grid, world.lattice)
            if len(world.circles):
                discs = cast_leaves(lidar, angles, range_max, world.discs, NO_WALLS)
                ranges = np.minimum(ranges, discs)
        moving = circles[len(world.circles) :], edges[len(world.edges) :]
        if len(moving[0]) or len(moving[1]):
            ranges = np.minimum(ranges, cast_shapes(lidar, angles, range_max, *moving))
        return ranges
