"""Search in x, y and heading for strokes that lead a robot out of a place in which it cannot turn."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats

STROKE = 0.025  # [m] forwards or back in one step
_HEADINGS = 96  # in a full turn
TURN = 2.0 * math.pi / _HEADINGS  # [rad] in one step
_STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))
_CELL = 0.02  # [m] places in the same cell, with the same heading, count as one
_RADIUS = 75  # cells around the robot that are searched
_POSES = 150_000  # poses that are searched
_ARRIVAL = 0.2  # [m] from a place that is to be reached
_ROUNDING = 1e-6  # [m] by which rounding may bring a point nearer


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
def _nearest_first(points, reach):
    """Sort the points within reach of the origin by distance, since a near one ends the search of `_is_kept` early."""
    squares = points[:, 0] ** 2 + points[:, 1] ** 2
    order = np.argsort(squares)
    return points[order[: np.searchsorted(squares[order], reach * reach)]]


@njit(cache=True, error_model="numpy")
def _keep_distances(points, box, margin):
    """Distance that each point has to keep from the footprint: the margin, or less if it is nearer now [m]."""
    keep_distances = np.empty(len(points))
    for m in range(len(points)):
        keep_distances[m] = min(margin, _distance(points[m, 0], points[m, 1], box) - _ROUNDING)
    return keep_distances


@njit(cache=True, error_model="numpy")
def _is_kept(points, keep_distances, pose, box):
    """Return whether all points are as far from the footprint at a pose as they have to be."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for m in range(len(points)):
        x, y = points[m, 0] - pose[0], points[m, 1] - pose[1]
        if _distance(cos * x + sin * y, cos * y - sin * x, box) < keep_distances[m]:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _distance(x, y, box):
    """Distance of a point in the robot frame from the footprint, negative inside [m]."""
    along, across = abs(x) - box[0], abs(y) - box[1]
    if along > 0.0 and across > 0.0:
        return math.sqrt(along * along + across * across) - box[2]
    return max(along, across) - box[2]


@njit(cache=True, error_model="numpy")
def _has_room(points, pose, room):
    """Return whether no point is nearer than `room` to a pose."""
    for m in range(len(points)):
        x, y = points[m, 0] - pose[0], points[m, 1] - pose[1]
        if x * x + y * y < room * room:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _from_start(steps, parents, goal):
    """Return the steps that lead from the first pose to the last one."""
    count, node = 0, goal
    while node > 0:
        count, node = count + 1, parents[node]
    path, node = np.empty((count, 2), np.int8), goal
    while node > 0:
        count -= 1
        path[count], node = steps[node], parents[node]
    return path
