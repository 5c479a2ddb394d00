"""Motion tubes along a path: the BARN Challenge entry of KU Leuven and Flanders Make."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.geometry.collision import sweep
from lme.geometry.frames import relative, to_world
from lme.perception.scan_points import obstacle_points
from lme.planners.commands import approach, limited, until_rest
from lme.planners.motion_tubes.kernels import Ranges, known_free, out_of_sight
from lme.planners.motion_tubes.tubes import (
    BackwardTubes,
    LidarView,
    Route,
    TubeChoice,
    TubeChoiceConfig,
    TubeGoal,
    backward_tubes,
    lidar_view,
)
from lme.robots import Footprint, Robot, towards
from lme.types import Bools, Floats, Guidance, Observation, Pose, Twist

_STANDSTILL = 0.025  # [m/s, rad/s] authors' public code
_STOP_RADIUS = 1.5  # [m] farther points are out of reach within one period and a stop
_MEMORY_RADIUS = 3.0  # [m] farther points are not remembered
_SCANS, _SCAN_SPACING, _SCAN_TURN = 60, 0.15, math.radians(20.0)  # memory of 9 m of driving
_BACK_STEP = math.radians(5.0)  # between final headings of backward tubes
_SLOWER = ((1.0, 1.0), (0.5, 0.5), (0.25, 0.25))  # shares of v and ω, on the same arc
_BACK_OUT = ((0.25, 0.0), (0.25, -0.25))  # off the arc, if there is no room to enter it
_GAP = 0.02  # [m] least clearance while stopping; a nearer robot must not come any nearer
_ORIGIN = Pose(0.0, 0.0, 0.0)
_NO_EDGES = np.empty((0, 4))


@dataclass(slots=True)
class MotionTubesConfig(TubeChoiceConfig):
    """Settings of tubes and their selection, accelerations and recovery."""

    acceleration: float
    deceleration: float
    stop_deceleration: float
    turn_margin: float
    turn_speed: float
    turn_acceleration: float
    turn_tolerance: float
    back_length: float
    back_speed: float
    back_bin: float
    rest_within: float

    def __post_init__(self) -> None:
        TubeChoiceConfig.__post_init__(self)
        for key in ("acceleration", "deceleration", "stop_deceleration", "turn_speed", "turn_acceleration"):
            require(key, getattr(self, key), above=0.0)
        for key in ("turn_tolerance", "back_length", "back_speed", "back_bin"):
            require(key, getattr(self, key), above=0.0)
        for key in ("turn_margin", "rest_within"):
            require(key, getattr(self, key), at_least=0.0)


class _Manoeuvre(Enum):
    FOLLOW = auto()
    STOP = auto()
    TURN = auto()
    BACK = auto()


class _Scene(NamedTuple):
    """Input of one decision. points: (M, 2) seen or remembered, in the robot frame [m]."""

    observation: Observation
    route: Route
    view: LidarView
    free_ranges: Ranges
    points: Floats


class MotionTubes:
    """Follows a path through tubes of free space (KUL+FM, winner of BARN's physical round 2023).

    A tube is the area that the footprint sweeps along an arc. It is free if each beam sees past its edge, which
    takes one comparison per beam with precomputed ranges (Teixeira Rodrigues et al., "Clutter-resilient autonomous
    mobile robot navigation with computationally efficient free-space features", DOI 10.1007/978-3-031-25555-7_35).
    The robot drives the free tube that ends nearest to the path's point at the tube's length. If no tube is free,
    it stops, turns along the path if there is room, and else backs up (Xiao et al., "Lessons Learned From the
    Second BARN Challenge at ICRA 2023", DOI 10.1109/MRA.2023.3322920). Rules and values are those of the authors'
    public code for Jackal. On other robots, the margins are added to the robot's footprint, the robot's limits cap
    the speeds, and the lengths stay, since they follow from the speeds.

    Differences: a third, short set of tubes for goals near walls and for narrow places (the authors' BARN code had
    lengths from 0.1 m). If the goal is nearer, tubes end there and miss it by at most one bin. Ahead, the area out
    of view is not free; behind, it is free only if an earlier scan saw past it or the robot stood there. Turning on
    the spot ends as soon as a forward tube is free. After any command, the robot can stop before every point that
    it sees or remembers. Obstacles are assumed to be static.
    """

    Config = MotionTubesConfig

    def __init__(self, config: MotionTubesConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._dt = robot.dt
        self._tubes = TubeChoice(config, robot)
        long_tubes, short_tubes = (
            self._tubes.spec(length, _BACK_STEP) for length in (config.back_length, config.near_length)
        )
        self._back = (long_tubes, short_tubes, short_tubes._replace(margins=(_GAP, _GAP)))
        self._surroundings = Surroundings(robot.footprint, _SCANS, _SCAN_SPACING, _SCAN_TURN)
        self._stuck: Pose | None = None  # pose where the free tube could not be entered
        self._forget()

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the scans and the state of recovery."""
        self._forget()

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        scene = self._scene(observation, guidance)
        if scene.route.left <= self._config.rest_within:
            self._state = _Manoeuvre.FOLLOW
            return self._stopping_in_time(self._brake(scene), scene)
        steps = {
            _Manoeuvre.FOLLOW: self._follow,
            _Manoeuvre.STOP: self._stop,
            _Manoeuvre.TURN: self._turn,
            _Manoeuvre.BACK: self._back_up,
        }
        desired = steps[self._state](scene)
        command = self._stopping_in_time(desired, scene)
        # Change the state if the chosen tube was not safe to enter.
        if command == Twist(0.0, 0.0) != desired:
            if self._state is _Manoeuvre.FOLLOW:
                self._state, self._stuck = _Manoeuvre.BACK, observation.odometry
            elif self._state is _Manoeuvre.BACK:
                self._state, self._stuck = _Manoeuvre.STOP, None
        return command

    def _forget(self) -> None:
        self._surroundings.forget()
        self._state = _Manoeuvre.FOLLOW
        self._stuck = None

    def _scene(self, observation: Observation, guidance: Guidance) -> _Scene:
        """Remember the scan and collect the input of the decision."""
        mount = self._robot.lidar.mount
        view, free_ranges = lidar_view(observation.scan, mount)
        points = obstacle_points(observation.scan, mount)
        self._surroundings.see(observation.odometry, view, free_ranges, _within(points, _MEMORY_RADIUS))
        points = np.concatenate((_within(points, _STOP_RADIUS), self._surroundings.hidden_hits(_STOP_RADIUS)))
        return _Scene(observation, self._tubes.route(guidance), view, free_ranges, points)

    def _follow(self, scene: _Scene) -> Twist:
        """Drive the best tube; brake if there is none."""
        config, twist, dt = self._config, scene.observation.ramp_start, self._dt
        tube = self._tubes.ahead(scene.route, twist, scene.view, scene.free_ranges)
        if tube is None:
            self._state = _Manoeuvre.STOP
            return self._brake(scene)
        limits = scene.observation.limits
        speed, braking = min(tube.speed, limits.v_max), min(config.stop_deceleration, limits.alpha_v)
        # Ramp to the speed of the tube, in time to stop at the end of the path and within reach of the turn rate.
        v = min(max(speed, twist.v - config.deceleration * dt), twist.v + config.acceleration * dt)
        v = min(v, approach(scene.route.left, twist.v, speed, braking, dt))
        v = self._limited_by_turn_rate(v, tube.curvature, scene.observation)
        return Twist(v, v * tube.curvature)

    def _limited_by_turn_rate(self, v: float, curvature: float, observation: Observation) -> float:
        """Limit the speed [m/s] so that the reachable turn rate keeps the robot in the tube."""
        limits = observation.limits
        desired = min(max(v * curvature, -limits.omega_max), limits.omega_max)
        omega = towards(desired, observation.ramp_start.omega, limits.alpha_omega, self._dt)
        if omega * curvature > 0.0:
            return min(v, omega / curvature)
        return v if curvature == 0.0 else min(v, self._config.near_speed)

    def _stop(self, scene: _Scene) -> Twist:
        """Brake until a tube is free; at a standstill, recover."""
        v, omega = scene.observation.ramp_start
        if v > -_STANDSTILL and self._tubes.ahead(
            scene.route, Twist(v, omega), scene.view, scene.free_ranges
        ):
            self._state = _Manoeuvre.FOLLOW
            return self._follow(scene)
        if max(abs(v), abs(omega)) > _STANDSTILL:
            return self._brake(scene)
        if self._turns_usefully(scene, self._config.turn_margin):
            self._state = _Manoeuvre.TURN
        elif self._backward_curvature(scene) is not None:
            self._state = _Manoeuvre.BACK
        elif self._turns_usefully(scene, _GAP):
            self._state = _Manoeuvre.TURN
        return self._turn(scene) if self._state is _Manoeuvre.TURN else self._back_up(scene)

    def _turn(self, scene: _Scene) -> Twist:
        """Turn on the spot until the robot faces along the path or can drive ahead."""
        bearing, config = self._tubes.bearing(scene.route), self._config
        is_aligned = abs(bearing) <= config.turn_tolerance or self._can_drive_ahead(scene)
        if is_aligned or not self._room_to_turn(scene, 0.0):
            self._state = _Manoeuvre.STOP
            return self._brake(scene)
        rate = scene.observation.ramp_start.omega
        return Twist(0.0, approach(bearing, rate, config.turn_speed, config.turn_acceleration, self._dt))

    def _back_up(self, scene: _Scene) -> Twist:
        """Back up until there is room to turn or the robot can drive ahead."""
        curvature = self._backward_curvature(scene)
        if curvature is None or self._has_backed_off(scene):
            self._state, self._stuck = _Manoeuvre.STOP, None
            return self._brake(scene)
        v = towards(
            -self._config.back_speed, scene.observation.ramp_start.v, self._config.deceleration, self._dt
        )
        return Twist(v, v * curvature)

    def _brake(self, scene: _Scene) -> Twist:
        """Brake to a stop on the current arc."""
        v, omega = scene.observation.ramp_start
        if abs(v) <= _STANDSTILL:
            return Twist(0.0, 0.0)
        slower = towards(0.0, v, self._config.stop_deceleration, self._dt)
        return Twist(slower, omega * slower / v)

    def _stopping_in_time(self, desired: Twist, scene: _Scene) -> Twist:
        """Return the command, or a similar one after which the robot can stop before every point; else brake."""
        circles = np.column_stack((scene.points, np.zeros(len(scene.points))))
        clearance, _ = sweep(np.array([_ORIGIN]), self._robot.footprint.box, circles, _NO_EDGES)
        # A robot that is nearer to a point than the gap need only keep its distance.
        for v_factor, omega_factor in _SLOWER if desired.v >= 0.0 else (*_SLOWER, *_BACK_OUT):
            command = limited(v_factor * desired.v, omega_factor * desired.omega, scene.observation, self._dt)
            if self._clearance(command, scene.observation, circles) >= min(_GAP, clearance - 1e-6):
                return command
        return limited(0.0, 0.0, scene.observation, self._dt)

    def _clearance(self, command: Twist, observation: Observation, circles: Floats) -> float:
        """Least distance to the points over one period of the command and a full stop [m]; −1 in contact."""
        min_clearance = math.inf
        for twist in observation.twists:
            poses = until_rest(command, twist, observation.limits, self._robot)
            clearance, contact = sweep(poses, self._robot.footprint.box, circles, _NO_EDGES)
            min_clearance = min(min_clearance, clearance if contact < 0 else -1.0)
        return min_clearance

    def _turns_usefully(self, scene: _Scene, margin: float) -> bool:
        is_off_path = abs(self._tubes.bearing(scene.route)) > self._config.turn_tolerance
        return is_off_path and self._room_to_turn(scene, margin)

    def _room_to_turn(self, scene: _Scene, margin: float) -> bool:
        """Return whether the circle that the footprint sweeps in a turn is free; a disc needs no room."""
        footprint = self._robot.footprint
        min_distance = float(np.hypot(*scene.points.T).min(initial=math.inf))
        return footprint.radius is not None or min_distance > footprint.circumscribed_radius + margin

    def _has_backed_off(self, scene: _Scene) -> bool:
        """Return whether the robot is far enough from where it got stuck and can turn or drive ahead."""
        pose = scene.observation.odometry
        if self._stuck is not None and math.dist(pose[:2], self._stuck[:2]) < self._config.near_length:
            return False
        return self._turns_usefully(scene, self._config.turn_margin) or self._can_drive_ahead(scene)

    def _can_drive_ahead(self, scene: _Scene) -> bool:
        """Return whether enough tubes are free, and one ends near the path (authors' public code: within one bin)."""
        tube = self._tubes.ahead(scene.route, scene.observation.ramp_start, scene.view, scene.free_ranges)
        return tube is not None and tube.share >= self._config.free_low and tube.bin <= 1

    def _backward_curvature(self, scene: _Scene) -> float | None:
        """Curvature of the best backward tube [1/m], a short one if no long one is free; None if none is free."""
        goal = self._tubes.goal(scene.route, self._config.short_length)
        for spec in self._back:
            tubes = backward_tubes(spec)
            unknown = ~self._surroundings.known_free(tubes.samples)
            free: Bools = ~np.any(tubes.inside[:, unknown], axis=1)
            if free.any():
                return self._middle(tubes, free, goal)
        return None

    def _middle(self, tubes: BackwardTubes, free: Bools, goal: TubeGoal) -> float:
        """Curvature of the middle tube in the widest fan of free tubes that end in the bin nearest to the goal."""
        distances = np.hypot(tubes.ends[:, 0] - goal.x, tubes.ends[:, 1] - goal.y)
        bins = np.floor(distances / self._config.back_bin)
        candidates = np.flatnonzero(free & (bins == bins[free].min()))
        # Runs of neighbouring tubes; of an even number in the widest, the flatter of both middle ones.
        fans = np.split(candidates, np.flatnonzero(np.diff(candidates) > 1) + 1)
        widest = max(fans, key=len)
        middle = widest[[(len(widest) - 1) // 2, len(widest) // 2]]
        return float(min(tubes.curvatures[middle], key=abs))


def _within(points: Floats, reach: float) -> Floats:
    """Return the points (M, 2) that are nearer than `reach` [m]."""
    nearby: Floats = points[points[:, 0] ** 2 + points[:, 1] ** 2 < reach * reach]
    return nearby


class Surroundings:
    """Latest scans and the robot's poses in the odometry frame. Obstacles are assumed to be static.

    A scan is kept if the robot has moved or turned enough since the last kept scan; the oldest scan is dropped.
    """

    def __init__(self, footprint: Footprint, capacity: int, spacing: float, turn: float) -> None:
        self._box = footprint.box
        self._capacity, self._spacing, self._turn = capacity, spacing, turn
        self.forget()

    def forget(self) -> None:
        """Forget all scans."""
        self._poses: list[Pose] = []
        self._ranges: list[Ranges] = []
        self._hits: list[Floats] = []  # of each scan, in the odometry frame
        self._view: LidarView | None = None

    def see(self, odometry: Pose, view: LidarView, free_ranges: Ranges, points: Floats) -> None:
        """Add a scan. It replaces the last one if the robot has not moved enough between the last two.

        points (M, 2): its obstacle points in the base frame [m].
        """
        if view != self._view:
            self.forget()
            self._view = view
        if len(self._poses) > 1 and not self._moved(self._poses[-2], self._poses[-1]):
            self._poses.pop()
            self._ranges.pop()
            self._hits.pop()
        self._poses.append(odometry)
        self._ranges.append(free_ranges)
        self._hits.append(to_world(points, odometry))
        for memory in (self._poses, self._ranges, self._hits):
            del memory[: -self._capacity]

    def hidden_hits(self, reach: float) -> Floats:
        """Return earlier points within `reach` of the base that are out of view now, in its frame: (K, 2) [m]."""
        view = self._view
        assert view is not None
        lidar = (view.x, view.y, view.first)
        hits = np.concatenate(self._hits)
        return np.asarray(out_of_sight(hits, self._poses[-1], lidar, view.increment, view.num_beams, reach))

    def known_free(self, points: Floats) -> Bools:
        """Return whether the robot has stood on or seen past each of the points (P, 2) in the base frame: (P,)."""
        view, bodies, lidars, ranges = self._in_base_frame()
        return np.asarray(known_free(points, bodies, lidars, ranges, view.increment, self._box))

    def _moved(self, previous: Pose, current: Pose) -> bool:
        _, _, turn = relative(current, previous)
        return math.dist(previous[:2], current[:2]) >= self._spacing or abs(turn) >= self._turn

    def _in_base_frame(self) -> tuple[LidarView, Floats, Floats, Ranges]:
        """Return the view, poses of base and lidar (M, 3) in the current base frame, ranges (M, B); newest first."""
        view = self._view
        assert view is not None
        bodies = np.array([relative(pose, self._poses[-1]) for pose in reversed(self._poses)])
        lidars = np.empty_like(bodies)
        lidars[:, 2] = bodies[:, 2] + view.first
        cos, sin = np.cos(bodies[:, 2]), np.sin(bodies[:, 2])
        lidars[:, 0] = bodies[:, 0] + cos * view.x - sin * view.y
        lidars[:, 1] = bodies[:, 1] + sin * view.x + cos * view.y
        return view, bodies, lidars, np.stack(self._ranges[::-1])
