"""Short memory of obstacle points, and the compiled functions that carry it along by dead reckoning."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.frames import compose, to_world
from lme.geometry.motion import WIDEST, movers_among
from lme.perception.dead_reckoning import DeadReckoning, Move
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Bools, Floats, Limits, Observation, Pose

_NOTHING, _NOBODY = np.empty((0, 2)), np.empty((0, 6))
_STANDING = 0.05  # [m/s] below this speed people count as standing
_MAX_STEP = 0.5  # [m] a person this near to where one stood a period ago is the same
_SORTED = 1.0  # [m] driven before points are sorted into near and far again
_SLACK = 0.15  # [m] a beam that ends less than this before a remembered point has seen its surface again
_SQUARE = 0.05  # [m] one point is kept per square of this side


@njit(cache=True, error_model="numpy")
def squares_around(reach: float, square: float) -> Bools:
    """Create the mask of squares within `reach` [m] that `remember` fills: all False, before and after each call."""
    side = 2 * _half(reach, square) + 1
    return np.zeros((side, side), np.bool_)


@njit(cache=True, error_model="numpy", inline="always")
def _half(reach, square):
    """Squares on each side of the robot's own."""
    return math.ceil(reach / square) + 1


@njit(cache=True, error_model="numpy")
def remember(
    taken: Bools,
    memory: Floats,
    points: Floats,
    ranges: NDArray[np.float32],
    beams: tuple[float, float],
    mount: tuple[float, float, float],
    pose: tuple[float, float, float],
    square: float,
    reach: float,
    slack: float,
    range_max: float,
) -> tuple[Floats, Floats]:
    """Merge the points of a scan with the remembered ones that it cannot see, one per square.

    Returns them in the carried frame and in the robot frame: (K, 2) each [m]. taken: `squares_around` the robot.
    memory (N, 2): remembered points in the carried frame [m]. points (M, 2): of the scan, in the robot frame. ranges
    (B,), and beams: first bearing and increment [rad] in the lidar's frame, which is at `mount`. pose: of the robot
    in the carried frame. square [m]: side of the squares. A remembered point is dropped if it is farther than `reach`
    [m] from the robot, or if its beam and both neighbours reach it, or nearly (`slack` [m]): then either a beam
    passed it, or the scan has a newer point of the same surface. Beams say nothing of points that are not at least
    `slack` nearer than `range_max` [m].
    """
    half = _half(reach, square)
    first_i, first_j = math.floor(pose[0] / square) - half, math.floor(pose[1] / square) - half
    merged = np.empty((len(points) + len(memory), 2))
    count = 0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    # Points of the scan in the carried frame, the first one in each square.
    for m in range(len(points)):
        px, py = points[m, 0], points[m, 1]
        if px * px + py * py > reach * reach:
            continue
        x, y = pose[0] + cos * px - sin * py, pose[1] + sin * px + cos * py
        i, j = math.floor(x / square) - first_i, math.floor(y / square) - first_j
        if not taken[i, j]:
            taken[i, j] = True
            merged[count, 0], merged[count, 1] = x, y
            count += 1
    # Remembered points in the squares that are left, unless the scan sees their place.
    lidar = pose[0] + cos * mount[0] - sin * mount[1], pose[1] + sin * mount[0] + cos * mount[1]
    first = pose[2] + mount[2] + beams[0]
    for n in range(len(memory)):
        x, y = memory[n, 0], memory[n, 1]
        if (x - pose[0]) ** 2 + (y - pose[1]) ** 2 > reach * reach:
            continue
        i, j = math.floor(x / square) - first_i, math.floor(y / square) - first_j
        if taken[i, j] or _in_sight(x - lidar[0], y - lidar[1], first, beams[1], ranges, slack, range_max):
            continue
        taken[i, j] = True
        merged[count, 0], merged[count, 1] = x, y
        count += 1
    # Leave `taken` as it was, and transform the kept points to the robot frame.
    merged, robot_points = merged[:count], np.empty((count, 2))
    for n in range(count):
        i, j = math.floor(merged[n, 0] / square) - first_i, math.floor(merged[n, 1] / square) - first_j
        taken[i, j] = False
        x, y = merged[n, 0] - pose[0], merged[n, 1] - pose[1]
        robot_points[n, 0], robot_points[n, 1] = cos * x + sin * y, cos * y - sin * x
    return merged, robot_points


@njit(cache=True, error_model="numpy")
def _in_sight(dx, dy, first, increment, ranges, slack, range_max):
    """Return whether the nearest beam and its neighbours end beyond a point, or less than `slack` before it."""
    # Beam nearest in angle, modulo a turn; there is none in the blind arc.
    turn = 2.0 * math.pi / abs(increment)
    beam = (math.atan2(dy, dx) - first) / increment
    beam -= turn * math.floor((beam + 0.5) / turn)
    middle = int(beam + 0.5)
    if middle >= len(ranges):
        return False
    distance = math.sqrt(dx * dx + dy * dy)
    if distance + slack > range_max:
        return False
    min_range = distance - slack
    for beam in range(max(middle - 1, 0), min(middle + 2, len(ranges))):  # noqa: SIM110 (slow when compiled)
        if not ranges[beam] > min_range:
            return False
    return True


class Memory:
    """Points seen so far, in a frame fixed to the ground that starts at the robot.

    The frame is carried by the mean twist of each control period (UpdatePos, paper §III.D, with the turn's middle
    heading); v and ω are taken to change at their limits of acceleration and then to hold. Where odometry is the
    better source, the frame follows it (`lme.perception.dead_reckoning`). It drifts like any dead reckoning, so only
    near and recent points can be relied on. A point is forgotten as soon as the scan sees its place, so points behind
    obstacles and in the blind arc are kept, and far ones until the robot comes back.
    """

    def __init__(self, robot: Robot, reach: float, keeps: bool = True, people: bool = True) -> None:
        """reach [m]: farther points are not used until the robot comes nearer.

        keeps: False leaves only the points of the current scan. people: False keeps the points of tracked people like
        all others.
        """
        self._remembers_points, self._separates_people = keeps, people
        self._dt = robot.dt
        self._mount = robot.lidar.mount
        self.pose = Pose(0.0, 0.0, 0.0)  # of the robot in the carried frame
        self.points: Floats = _NOTHING  # in the carried frame
        self.known: Floats = _NOTHING  # the same in the robot frame
        self._far_points: Floats = _NOTHING  # out of reach, in the carried frame
        self._sorted_at = self.pose
        self._inner = reach + _SORTED
        self._reach = self._inner + _SORTED  # holds all points within `reach`, wherever they were last sorted
        self._squares = squares_around(self._reach, _SQUARE)
        self.seen: Floats = _NOTHING  # points of the last scan in the robot frame, sorted by bearing
        # (P, 6) x, y, vx, vy, radius of tracked people in the carried frame [m, m/s], and time they have stood [s]
        self.people = _NOBODY
        self._reckoning = DeadReckoning(self._dt)

    def see(self, observation: Observation) -> None:
        """Advance one control period and take in the scan."""
        scan, move = observation.scan, self._reckoning.move(observation)
        if move is not None:
            self.pose = _moved(self.pose, move, self._dt, observation.limits)
        self.seen = obstacle_points(scan, self._mount)
        static_points, people_points = self._without_people(observation.pedestrians)
        # Points that have come into reach join the near ones; those that have left it are put aside.
        if math.dist(self.pose[:2], self._sorted_at[:2]) >= _SORTED:
            self._sorted_at = self.pose
            if self._remembers_points:
                points = np.concatenate((self.points, self._far_points))
                is_near = np.hypot(*(points - self.pose[:2]).T) <= self._inner
                self.points, self._far_points = points[is_near], points[~is_near]
        self.points, self.known = remember(
            self._squares,
            self.points if self._remembers_points else self.points[:0],
            static_points,
            scan.ranges,
            (scan.angle_min, scan.angle_increment),
            (*self._mount,),
            (*self.pose,),  # plain tuples, which Numba recognises faster
            _SQUARE,
            self._reach,
            _SLACK,
            scan.range_max,
        )
        if len(people_points):
            self.known = np.concatenate((self.known, people_points))

    def _without_people(self, pedestrians: Floats) -> tuple[Floats, Floats]:
        """Split the scan's points into those of no person and those of people, (M, 2) each; note where people are."""
        previous, self.people = self.people, _NOBODY
        if not (self._separates_people and len(pedestrians)):
            return self.seen, self.seen[:0]
        is_person, people = movers_among(self.seen, self.seen, pedestrians, WIDEST)
        people[:, :2] = to_world(people[:, :2], self.pose)
        people[:, 2:4] = to_world(people[:, 2:4], Pose(0.0, 0.0, self.pose.yaw))
        self.people = np.column_stack((people, self._standing(people, previous)))
        return self.seen[~is_person], self.seen[is_person]

    def _standing(self, people: Floats, previous: Floats) -> Floats:
        """Time for which each of the people (P, 5) has stood [s]: (P,), by those of the last period (Q, 6)."""
        is_still = np.hypot(people[:, 2], people[:, 3]) < _STANDING
        if not (is_still.any() and len(previous)):
            return np.zeros(len(people))
        distances = np.hypot(*(people[:, None, :2] - previous[:, :2]).transpose(2, 0, 1))
        nearest = distances.argmin(axis=1)
        is_known = is_still & (distances.min(axis=1) < _MAX_STEP)
        return np.where(is_known, previous[nearest, 5] + self._dt, 0.0)


def _moved(pose: Pose, move: Move, dt: float, limits: Limits) -> Pose:
    """Return the pose one control period later."""
    if move.pose is not None:
        x, y, yaw = compose(pose, move.pose)
        return Pose(x, y, yaw)
    previous, current = move.before, move.now
    distance = _ramp_distance(previous.v, current.v, limits.alpha_v, dt)
    turn = _ramp_distance(previous.omega, current.omega, limits.alpha_omega, dt)
    middle = pose.yaw + turn / 2
    return Pose(pose.x + distance * math.cos(middle), pose.y + distance * math.sin(middle), pose.yaw + turn)


def _ramp_distance(initial: float, final: float, alpha: float, dt: float) -> float:
    """Integral over `dt` of a rate that changes from `initial` to `final` at `alpha` and then holds."""
    ramp = min(abs(final - initial) / alpha, dt)
    return (initial + final) / 2 * ramp + final * (dt - ramp)
