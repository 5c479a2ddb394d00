"""Short memory of obstacle points, carried along by dead reckoning."""

from __future__ import annotations

import math

import numpy as np

from lme.dead_reckoning import DeadReckoning, Move
from lme.geometry.frames import compose, to_world
from lme.kernels.movers import WIDEST, movers_among
from lme.policies.lme_plus.kernels.carried_points import remember, split, squares_around
from lme.robots import Robot
from lme.sensing.scan_points import obstacle_points
from lme.types import Floats, Limits, Observation, Pose

_NOTHING, _NOBODY = np.empty((0, 2)), np.empty((0, 6))
_STANDING = 0.05  # [m/s] slower people stand
_SAME = 0.5  # [m] from where somebody stood a period ago: the same person
_SORTED = 1.0  # [m] of way after which points near and far are sorted again
_SLACK = 0.15  # [m] a beam that ends less than this before a remembered point has seen its surface again
_SQUARE = 0.05  # [m] one point is kept per square of this side


class Memory:
    """Points seen so far, in a frame fixed to the ground that starts at the robot.

    The frame is carried by the mean twist of each control period (UpdatePos, paper §III.D, with the turn's middle
    heading); v and ω are taken to change at their limits of acceleration and then to hold. Where odometry is the better
    source, it is carried by that (`lme.dead_reckoning`). It drifts like any dead reckoning, so only near and recent
    points can be relied on. A point is forgotten as soon as the scan sees its place,
    so points behind obstacles and in the blind arc are kept, and far ones until the robot comes back.
    """

    def __init__(self, robot: Robot, reach: float, keeps: bool = True, people: bool = True) -> None:
        """reach: farther points are out of use until the robot comes nearer [m].

        keeps: if not, only the points of the current scan are known. people: if not, the points of tracked people are
        kept like all others.
        """
        self._keeps, self._tells_people = keeps, people
        self._dt = robot.dt
        self._mount = robot.lidar.mount
        self.pose = Pose(0.0, 0.0, 0.0)  # of the robot in the carried frame
        self.points: Floats = _NOTHING  # in the carried frame
        self.known: Floats = _NOTHING  # the same in the robot frame
        self._far: Floats = _NOTHING  # out of reach, in the carried frame
        self._sorted_at = self.pose
        self._near = reach + _SORTED
        self._reach = self._near + _SORTED  # the points of `reach` are all in, wherever they were sorted
        self._taken = squares_around(self._reach, _SQUARE)
        self.seen: Floats = _NOTHING  # points of the last scan in the robot frame, sorted by bearing
        # (P, 6) x, y, vx, vy, radius of tracked people in the carried frame [m, m/s], and for how long they stand [s]
        self.people = _NOBODY
        self._reckoning = DeadReckoning(self._dt)

    def see(self, observation: Observation) -> None:
        """Advance one control period and take in the scan."""
        scan, move = observation.scan, self._reckoning.move(observation)
        if move is not None:
            self.pose = _moved(self.pose, move, self._dt, observation.limits)
        self.seen = obstacle_points(scan, self._mount)
        still, theirs = self._without_people(observation.pedestrians)
        if math.dist(self.pose[:2], self._sorted_at[:2]) >= _SORTED:
            self._sort()
        self.points, self.known = remember(
            self._taken,
            self.points if self._keeps else self.points[:0],
            still,
            scan.ranges,
            (scan.angle_min, scan.angle_increment),
            (*self._mount,),
            (*self.pose,),  # plain tuples, which Numba recognises faster
            _SQUARE,
            self._reach,
            _SLACK,
            scan.range_max,
        )
        if len(theirs):
            self.known = np.concatenate((self.known, theirs))

    def _sort(self) -> None:
        """Put the points that have come into reach among the near ones, and those that have left it among the far."""
        self._sorted_at = self.pose
        if self._keeps:
            points = np.concatenate((self.points, self._far))
            self.points, self._far = split(points, self.pose[:2], self._near)

    def _without_people(self, pedestrians: Floats) -> tuple[Floats, Floats]:
        """The scan's points that are not those of people (M, 2), and those that are; notes where the people are."""
        before, self.people = self.people, _NOBODY
        if not (self._tells_people and len(pedestrians)):
            return self.seen, self.seen[:0]
        own, people = movers_among(self.seen, self.seen, pedestrians, WIDEST)
        people[:, :2] = to_world(people[:, :2], self.pose)
        people[:, 2:4] = to_world(people[:, 2:4], Pose(0.0, 0.0, self.pose.yaw))
        self.people = np.column_stack((people, self._standing(people, before)))
        return self.seen[~own], self.seen[own]

    def _standing(self, people: Floats, before: Floats) -> Floats:
        """For how long each of the people (P, 5) stands (P,) [s], by those of the last period (Q, 6)."""
        still = np.hypot(people[:, 2], people[:, 3]) < _STANDING
        if not (still.any() and len(before)):
            return np.zeros(len(people))
        away = np.hypot(*(people[:, None, :2] - before[:, :2]).transpose(2, 0, 1))
        same = away.argmin(axis=1)
        known = still & (away.min(axis=1) < _SAME)
        return np.where(known, before[same, 5] + self._dt, 0.0)


def _moved(pose: Pose, move: Move, dt: float, limits: Limits) -> Pose:
    """The pose one control period later."""
    if move.pose is not None:
        x, y, yaw = compose(pose, move.pose)
        return Pose(x, y, yaw)
    before, now = move.before, move.now
    distance = _way(before.v, now.v, limits.alpha_v, dt)
    turn = _way(before.omega, now.omega, limits.alpha_omega, dt)
    middle = pose.yaw + turn / 2
    return Pose(pose.x + distance * math.cos(middle), pose.y + distance * math.sin(middle), pose.yaw + turn)


def _way(before: float, now: float, alpha: float, dt: float) -> float:
    """Integral over `dt` of a rate that changes from `before` to `now` at `alpha` and then holds."""
    ramp = min(abs(now - before) / alpha, dt)
    return (before + now) / 2 * ramp + now * (dt - ramp)
