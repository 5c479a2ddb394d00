"""Multi-point turns: strokes forwards, backwards and on the spot, out of a place in which a robot cannot turn."""

from __future__ import annotations

import functools
import itertools
import math
from collections import deque

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.frames import wrap_angle
from lme.planners.commands import approach
from lme.planners.safety.check import STILL
from lme.robots import Footprint
from lme.types import Floats, Ints, Limits, Twist

_AFTER = 2.0  # [s] without a free way, after which a turn begins
_CLOSE = 0.4  # share of the margin that is kept
_ROOM = 2.0  # times the margin that the circle around the robot needs to turn on the spot
_SPEED, _MAX_SPEED = 0.25, 0.2  # share of v_max, at most [m/s]
_RATE, _MAX_RATE = 0.5, 0.5  # share of omega_max, at most [rad/s]
_MIN_BACK_SPEED = 0.05  # [m/s] a robot that can only back up more slowly counts as unable to back up
_TOLERANCE = 0.01  # [m, rad] with less than this left, a stroke is over
_RESTS = 0.05  # [m/s, rad/s] below this measured motion the robot counts as standing
_BRAKING = 1.0  # [s] after which it counts as standing, whatever its odometry says
_TIMEOUT, _EXTRA = 5.0, 2.0  # a stroke is given up after this many times its duration, plus [s]
_PATH_INDEX = 1  # index of the place on the fastest way that it drives to if there is no room
_NOWHERE = np.full(2, np.inf)

# Search in x, y and heading.
STROKE = 0.025  # [m] forwards or back in one step
_HEADINGS = 96  # in a full turn
TURN = 2.0 * math.pi / _HEADINGS  # [rad] in one step
_STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))
_CELL = 0.02  # [m] places in the same cell, with the same heading, count as one
_RADIUS = 75  # cells around the robot that are searched
_POSES = 150_000  # poses that are searched
_ARRIVAL = 0.2  # [m] from a place that is to be reached
_ROUNDING = 1e-6  # [m] by which rounding may bring a point nearer


class MultiPointTurn:
    """Leads a robot without a free way for some time to a place with room to turn on the spot, and turns it there.

    A body that is longer than wide can reach places on arcs that it can leave only by strokes. A search in x, y and
    heading finds a few steps to a place with room (`way_out`), and the strokes are driven one after the other, to the
    end. There the robot turns to the fastest way. If there is no place with room nearby, it drives to a place on the
    fastest way, forwards or backwards, and searches again; it also does so where a point appears on a stroke. A
    stroke that takes far too long, for instance because the robot does not move, ends the turn. With a known delay,
    progress is measured by the commands.
    """

    def __init__(self, footprint: Footprint, dt: float, margin: float) -> None:
        """dt: control period [s]; margin: distance kept to points [m]."""
        self._dt = dt
        self._box = footprint.box
        self._reduced_margin = _CLOSE * margin
        self._room = footprint.circumscribed_radius + _ROOM * margin
        self.reset()
        _load()

    def reset(self) -> None:
        """Forget the strokes, and for how long there was no free way."""
        self._blocked_for = 0.0  # [s] longer than not
        self._previous_twist = STILL
        self._braking = 0.0  # [s] for which it was to stand
        self._strokes: deque[tuple[int, int]] = deque()  # signs of v and ω, one of them 0
        self._lengths: deque[float] = deque()  # of each stroke [m, rad]
        self._time_left = 0.0  # [s] of the first stroke
        self._may_repeat = False  # there is no room at the end of the strokes

    def command(
        self, blocked: bool, points: Floats, path: Floats, twist: Twist, limits: Limits
    ) -> Twist | None:
        """Advance by one period and return the command; None: no turn is under way.

        blocked: the guide finds no free way in this period; points (M, 2): obstacles; path (K, 2): places on the
        fastest way, in the robot frame [m]; twist [m/s, rad/s]. While the robot comes to rest, the command
        is zero.
        """
        self._count(twist, limits)
        # Count the time without a free way; a turn begins after enough of it.
        if not self._strokes:
            self._blocked_for = max(self._blocked_for + (self._dt if blocked else -self._dt), 0.0)
            begins = self._blocked_for > _AFTER
            if not begins and not self._may_repeat:
                return None
        # Stop, and search from standstill, at the beginning and where a stroke is no longer free.
        if not self._strokes or not self._is_free(points):
            if not self._is_at_rest(twist):
                return STILL
            self._plan_strokes(points, path, limits)
        return self._on_stroke(twist, limits) if self._strokes else None

    def _count(self, twist: Twist, limits: Limits) -> None:
        """Subtract the motion of the last period; begin the next stroke once the robot has come to rest."""
        previous, self._previous_twist = self._previous_twist, twist
        if not self._strokes:
            return
        ahead, turn = self._strokes[0]
        driven = ahead * (previous.v + twist.v) + turn * (previous.omega + twist.omega)
        self._lengths[0] -= 0.5 * driven * self._dt
        self._time_left -= self._dt
        if self._lengths[0] < _TOLERANCE and self._is_at_rest(twist):
            self._strokes.popleft()
            self._lengths.popleft()
            self._begin(limits)
        elif self._time_left < 0.0:
            self.reset()

    def _is_at_rest(self, twist: Twist) -> bool:
        """Return whether the robot, which has to stop, is at rest."""
        self._braking += self._dt
        return max(abs(twist.v), abs(twist.omega)) < _RESTS or self._braking > _BRAKING

    def _begin(self, limits: Limits) -> None:
        """Begin the first stroke that is left, if there is one."""
        self._braking = 0.0
        if self._strokes:
            rate = _rates(limits)[0 if self._strokes[0][0] else 1]
            self._time_left = _TIMEOUT * self._lengths[0] / max(rate, _RESTS) + _EXTRA

    def _is_free(self, points: Floats) -> bool:
        """Return whether the rest of the stroke is free."""
        (ahead, turn), remaining = self._strokes[0], max(self._lengths[0], 0.0)
        return bool(
            keeps_on_stroke(points, self._box, self._reduced_margin, ahead * remaining, turn * remaining)
        )

    def _plan_strokes(self, points: Floats, path: Floats, limits: Limits) -> None:
        """Look for strokes from where the robot stands."""
        self.reset()
        goal = path[min(_PATH_INDEX, len(path) - 1)] if len(path) else _NOWHERE
        backwards = limits.lowest <= -_MIN_BACK_SPEED
        steps, room = way_out(points, self._box, self._reduced_margin, self._room, goal, backwards)
        # Join equal steps to strokes.
        for (ahead, turn), run in itertools.groupby(map(tuple, steps.tolist())):
            self._strokes.append((ahead, turn))
            self._lengths.append(len(list(run)) * (STROKE if ahead else TURN))
        self._may_repeat = len(steps) > 0 and not room
        # Where there is room at the end, turn to the fastest way as a last stroke.
        if len(steps) and room and len(path):
            angle = _turn_to(path, poses_after(steps)[-1])
            self._strokes.append((0, 1 if angle > 0.0 else -1))
            self._lengths.append(abs(angle))
        self._begin(limits)

    def _on_stroke(self, twist: Twist, limits: Limits) -> Twist:
        """Return the command on the stroke, so that the robot is at rest at its end."""
        (ahead, turn), (speed, rate) = self._strokes[0], _rates(limits)
        length = self._lengths[0] if self._lengths[0] > _TOLERANCE else 0.0  # an overshoot is not driven back
        v = approach(ahead * length, twist.v, speed, limits.alpha_v, self._dt)
        return Twist(v, approach(turn * length, twist.omega, rate, limits.alpha_omega, self._dt))


@functools.cache
def _load() -> None:
    """Load the compiled search once per process, so that a robot that is stuck need not wait for it."""
    point, box = np.array([[0.4, 0.0]]), (0.3, 0.2, 0.0)
    way_out(point, box, 0.02, 0.41, _NOWHERE, True)
    keeps_on_stroke(point, box, 0.02, STROKE, 0.0)


def _rates(limits: Limits) -> tuple[float, float]:
    """Speed [m/s] and turn rate [rad/s] on strokes; the planner limits both by what the robot can do."""
    return min(_SPEED * limits.v_max, _MAX_SPEED), min(_RATE * limits.omega_max, _MAX_RATE)


def _turn_to(path: Floats, pose: Floats) -> float:
    """Angle by which a robot at the pose (3,) has to turn to face along the path (K, 2) [rad]."""
    nearest = int(np.hypot(*(path - pose[:2]).T).argmin())
    x, y = path[min(nearest + 1, len(path) - 1)] - pose[:2]
    return wrap_angle(math.atan2(y, x) - float(pose[2]))


@njit(cache=True, error_model="numpy")
def way_out(
    points: Floats,
    box: tuple[float, float, float],
    margin: float,
    room: float,
    goal: Floats,
    backwards: bool,
) -> tuple[NDArray[np.int8], bool]:
    """Find a few steps (K, 2) to where the centre is at least `room` [m] from all points; return them and True.

    A step is a row of two signs: 1 for forwards by `STROKE`, −1 for backwards, or 0; and 1 for left by `TURN`, −1 for
    right, or 0. points (M, 2): in the robot frame [m]; box: footprint (half_length, half_width, rounding) [m], which
    keeps `margin` [m]; a point that is nearer already must not come any nearer. backwards: whether the robot can
    drive backwards. The search is breadth-first, up to 1.5 m from the robot and over `_POSES` poses. If it finds no
    such place, it returns steps that lead to within `_ARRIVAL` of the `goal` (2,) [m], or none, and False.
    """
    r_max = math.hypot(box[0], box[1]) + box[2]
    nearby = _nearest_first(points, (_RADIUS + 1) * _CELL + max(room, r_max + margin))
    # Nothing to do where the robot has room already.
    if _has_room(nearby, np.zeros(3), room):
        return np.empty((0, 2), np.int8), True
    keep_distances, width = _keep_distances(nearby, box, margin), 2 * _RADIUS + 1
    # Breadth-first search over cells of x, y and heading; `poses` is the queue from `head` to `count`.
    is_visited = np.zeros((width, width, _HEADINGS), np.bool_)
    poses, steps, parents = np.zeros((_POSES, 3)), np.zeros((_POSES, 2), np.int8), np.zeros(_POSES, np.int64)
    is_visited[_RADIUS, _RADIUS, 0] = True
    head, count, arrived = 0, 1, 0
    while head < count < _POSES - len(_STEPS):
        for k in range(-1, len(_STEPS)):  # first the step that led here, so that the strokes are few
            ahead, turn = _STEPS[k] if k >= 0 else (steps[head, 0], steps[head, 1])
            if ahead == turn == 0 or (ahead < 0 and not backwards):
                continue
            # Pose after the step, which is a stroke or a turn, and its cell.
            yaw = poses[head, 2] + turn * TURN
            x = poses[head, 0] + ahead * STROKE * math.cos(yaw)
            y = poses[head, 1] + ahead * STROKE * math.sin(yaw)
            i, j = math.floor(x / _CELL + 0.5), math.floor(y / _CELL + 0.5)
            cell = i + _RADIUS, j + _RADIUS, math.floor(yaw / TURN + 0.5) % _HEADINGS
            if i * i + j * j > _RADIUS * _RADIUS or is_visited[cell]:
                continue
            poses[count, 0], poses[count, 1], poses[count, 2] = x, y, yaw
            if not _is_kept(nearby, keep_distances, poses[count], box):
                continue
            is_visited[cell] = True
            steps[count, 0], steps[count, 1], parents[count] = ahead, turn, head
            # Done at the first pose with room; the first pose close to `goal` is the second choice.
            if _has_room(nearby, poses[count], room):
                return _from_start(steps, parents, count), True
            if arrived == 0 and (x - goal[0]) ** 2 + (y - goal[1]) ** 2 < _ARRIVAL * _ARRIVAL:
                arrived = count
            count += 1
        head += 1
    return _from_start(steps, parents, arrived), False


def poses_after(steps: NDArray[np.int8]) -> Floats:
    """Poses after each of the steps (K, 2) from the origin: x, y [m] and yaw [rad], (K, 3)."""
    yaw = TURN * np.cumsum(steps[:, 1])
    ahead = STROKE * steps[:, 0]
    return np.column_stack((np.cumsum(ahead * np.cos(yaw)), np.cumsum(ahead * np.sin(yaw)), yaw))


@njit(cache=True, error_model="numpy")
def keeps_on_stroke(
    points: Floats, box: tuple[float, float, float], margin: float, ahead: float, turn: float
) -> bool:
    """Return whether points (M, 2) keep `margin`, as in `way_out`, on a drive `ahead` [m] or a turn [rad]."""
    keep_distances = _keep_distances(points, box, margin)
    number = max(math.ceil(abs(ahead) / STROKE), math.ceil(abs(turn) / TURN))
    pose = np.zeros(3)
    for k in range(1, number + 1):
        pose[0], pose[2] = ahead * k / number, turn * k / number
        if not _is_kept(points, keep_distances, pose, box):
            return False
    return True


@njit(cache=True, error_model="numpy")
def _nearest_first(points: Floats, reach: float) -> Floats:
    """Sort the points within reach of the origin by distance, since a near one ends the search of `_is_kept` early."""
    squares = points[:, 0] ** 2 + points[:, 1] ** 2
    order = np.argsort(squares)
    return points[order[: np.searchsorted(squares[order], reach * reach)]]


@njit(cache=True, error_model="numpy")
def _keep_distances(points: Floats, box: tuple[float, float, float], margin: float) -> Floats:
    """Distance that each point has to keep from the footprint: the margin, or less if it is nearer now [m]."""
    keep_distances = np.empty(len(points))
    for m in range(len(points)):
        keep_distances[m] = min(margin, _distance(points[m, 0], points[m, 1], box) - _ROUNDING)
    return keep_distances


@njit(cache=True, error_model="numpy")
def _is_kept(points: Floats, keep_distances: Floats, pose: Floats, box: tuple[float, float, float]) -> bool:
    """Return whether all points are as far from the footprint at a pose as they have to be."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for m in range(len(points)):
        x, y = points[m, 0] - pose[0], points[m, 1] - pose[1]
        if _distance(cos * x + sin * y, cos * y - sin * x, box) < keep_distances[m]:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _distance(x: float, y: float, box: tuple[float, float, float]) -> float:
    """Distance of a point in the robot frame from the footprint, negative inside [m]."""
    along, across = abs(x) - box[0], abs(y) - box[1]
    if along > 0.0 and across > 0.0:
        return math.sqrt(along * along + across * across) - box[2]
    return max(along, across) - box[2]


@njit(cache=True, error_model="numpy")
def _has_room(points: Floats, pose: Floats, room: float) -> bool:
    """Return whether no point is nearer than `room` to a pose."""
    for m in range(len(points)):
        x, y = points[m, 0] - pose[0], points[m, 1] - pose[1]
        if x * x + y * y < room * room:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _from_start(steps: NDArray[np.int8], parents: Ints, goal: int) -> NDArray[np.int8]:
    """Return the steps that lead from the first pose to the last one."""
    count, node = 0, goal
    while node > 0:
        count, node = count + 1, parents[node]
    path, node = np.empty((count, 2), np.int8), goal
    while node > 0:
        count -= 1
        path[count], node = steps[node], parents[node]
    return path
