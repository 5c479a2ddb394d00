"""Memory of obstacle points around the robot, in a frame that dead reckoning carries along."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Bools, Floats


@njit(cache=True, error_model="numpy")
def squares_around(reach: float, square: float) -> Bools:
    """Whether each square within `reach` [m] has a point, for `remember`: none has, before and after each call."""
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
    """Points of a scan and the remembered ones that it cannot see, one per square: (K, 2), and in the robot frame.

    taken: `squares_around` the robot. memory (N, 2), and the first result: in the carried frame [m]. points (M, 2): of
    the scan, in the robot frame. ranges (B,), and beams: first bearing and increment [rad] in the lidar's frame, which
    is at `mount`. pose: of the robot in the carried frame. square [m]: side of the squares. A remembered point is
    dropped if it is farther than `reach` [m] from the robot, or if its beam and both neighbours reach it, or nearly
    (`slack` [m]): then either a beam passed it, or the scan has a newer point of the same surface. Beams say nothing of
    points that are not `slack` nearer than `range_max` [m].
    """
    half = _half(reach, square)
    first_i, first_j = math.floor(pose[0] / square) - half, math.floor(pose[1] / square) - half
    kept = np.empty((len(points) + len(memory), 2))
    count = 0
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for m in range(len(points)):
        px, py = points[m, 0], points[m, 1]
        if px * px + py * py > reach * reach:
            continue
        x, y = pose[0] + cos * px - sin * py, pose[1] + sin * px + cos * py
        i, j = math.floor(x / square) - first_i, math.floor(y / square) - first_j
        if not taken[i, j]:
            taken[i, j] = True
            kept[count, 0], kept[count, 1] = x, y
            count += 1
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
        kept[count, 0], kept[count, 1] = x, y
        count += 1
    kept, around = kept[:count], np.empty((count, 2))
    for n in range(count):
        i, j = math.floor(kept[n, 0] / square) - first_i, math.floor(kept[n, 1] / square) - first_j
        taken[i, j] = False
        x, y = kept[n, 0] - pose[0], kept[n, 1] - pose[1]
        around[n, 0], around[n, 1] = cos * x + sin * y, cos * y - sin * x
    return kept, around


@njit(cache=True, error_model="numpy")
def _in_sight(dx, dy, first, increment, ranges, slack, range_max):
    """Whether the beam nearest in angle and its neighbours end beyond the point, or less than `slack` before it."""
    turn = 2.0 * math.pi / abs(increment)
    beam = (math.atan2(dy, dx) - first) / increment
    beam -= turn * math.floor((beam + 0.5) / turn)
    middle = int(beam + 0.5)
    if middle >= len(ranges):
        return False
    distance = math.sqrt(dx * dx + dy * dy)
    if distance + slack > range_max:
        return False
    away = distance - slack
    for beam in range(max(middle - 1, 0), min(middle + 2, len(ranges))):  # noqa: SIM110 (slow when compiled)
        if not ranges[beam] > away:
            return False
    return True


@njit(cache=True, error_model="numpy")
def split(points: Floats, place: tuple[float, float], reach: float) -> tuple[Floats, Floats]:
    """The points (N, 2) within `reach` of a place [m], and the others, each in their order."""
    near = np.empty(len(points), np.bool_)
    for n in range(len(points)):
        near[n] = math.hypot(points[n, 0] - place[0], points[n, 1] - place[1]) <= reach
    return points[near], points[~near]
