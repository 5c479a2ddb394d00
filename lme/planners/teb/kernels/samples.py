"""Samples of a timed elastic band: made along a path, added and removed, and the obstacles near them.

A band is poses (N, 3) [m, m, rad] and the time differences (N − 1,) [s] between them.
"""

import math

import numpy as np
from numba import njit

from lme.types import Floats

_PASSES = 100  # of `resized`, at most, as in teb_local_planner


@njit(cache=True, error_model="numpy")
def along(
    path: Floats, start: tuple[float, float, float], yaw: float, v_max: float, omega_max: float
) -> tuple[Floats, Floats]:
    """A band from `start` along the path (P, 2), P ≥ 1, to its end with heading `yaw`, as fast as the limits allow.

    A pose at each point of the path, which heads for the next one, and one half-way if P = 1.
    """
    line = path if len(path) > 1 else np.vstack((0.5 * (path + np.array([[start[0], start[1]]])), path))
    count = len(line) + 1
    poses = np.empty((count, 3))
    poses[0] = start
    for k in range(1, count):
        poses[k, :2] = line[k - 1]
        poses[k, 2] = yaw
        if k < count - 1:
            poses[k, 2] = math.atan2(line[k, 1] - line[k - 1, 1], line[k, 0] - line[k - 1, 0])
    times = np.empty(count - 1)
    for k in range(count - 1):
        way = math.hypot(poses[k + 1, 0] - poses[k, 0], poses[k + 1, 1] - poses[k, 1])
        turn = abs(wrapped(poses[k + 1, 2] - poses[k, 2]))
        times[k] = max(way / v_max, turn / omega_max, 1e-3)
    return poses, times


@njit(cache=True, error_model="numpy")
def resized(
    poses: Floats, times: Floats, wanted: float, hysteresis: float, fewest: int, most: int
) -> tuple[Floats, Floats]:
    """The band with time differences near `wanted` [s]: samples are added and removed where they are off.

    hysteresis [s]: the greatest difference. `fewest` and `most`: limits of the number of time differences.
    """
    size = max(most, len(times)) + 1
    p, t = np.empty((size, 3)), np.empty(size)
    count = len(times)
    p[: count + 1], t[:count] = poses, times
    for _ in range(_PASSES):
        modified, i = False, 0
        while i < count:
            if t[i] > wanted + hysteresis and count < most:
                if t[i] > 2.0 * wanted:
                    count = _split(p, t, count, i)
                    modified = True
                    continue  # looks at the first half again
                if i < count - 1:
                    t[i + 1] += t[i] - wanted
                t[i] = wanted
            elif t[i] < wanted - hysteresis and count > fewest:
                modified = True
                count = _merge(p, t, count, i)
                if i < count:
                    continue
            i += 1
        if not modified:
            break
    return p[: count + 1].copy(), t[:count].copy()


@njit(cache=True, error_model="numpy")
def _split(p, t, count, i):
    """Add a pose half-way between poses i and i + 1; the new number of time differences."""
    for k in range(count, i, -1):
        p[k + 1], t[k] = p[k], t[k - 1]
    p[i + 1, :2] = 0.5 * (p[i, :2] + p[i + 2, :2])
    p[i + 1, 2] = wrapped(p[i, 2] + 0.5 * wrapped(p[i + 2, 2] - p[i, 2]))
    t[i] *= 0.5
    t[i + 1] = t[i]
    return count + 1


@njit(cache=True, error_model="numpy")
def _merge(p, t, count, i):
    """Remove the pose after difference i, or before it if that is the last one; the new number of differences."""
    gone = i if i < count - 1 else i - 1
    t[gone + 1] += t[gone]
    for k in range(gone, count - 1):
        t[k] = t[k + 1]
    for k in range(gone + 1, count):
        p[k] = p[k + 1]
    return count - 1


@njit(cache=True, error_model="numpy")
def near_obstacles(
    poses: Floats, points: Floats, box: tuple[float, float, float], always: float, never: float
) -> Floats:
    """Which points (M, 2) [m] count at which poses: (K, 3) [index of the pose, x, y].

    At each pose but the first and the last: all points nearer than `always` to the footprint `box`, and of the
    others up to `never` the nearest on its left and on its right [m].
    """
    out = np.empty((len(poses) * (len(points) + 2), 3))
    reach = never + math.hypot(box[0], box[1]) + box[2]
    count = 0
    for i in range(1, len(poses) - 1):
        left, right, on_left, on_right = np.inf, np.inf, -1, -1
        for k in range(len(points)):
            dx, dy = points[k, 0] - poses[i, 0], points[k, 1] - poses[i, 1]
            if dx * dx + dy * dy > reach * reach:
                continue
            distance = clearance(poses[i], points[k, 0], points[k, 1], box)[0]
            if distance < always:
                count = _list(out, count, i, points[k])
            elif distance <= never:
                if math.cos(poses[i, 2]) * dy - math.sin(poses[i, 2]) * dx > 0.0:
                    if distance < left:
                        left, on_left = distance, k
                elif distance < right:
                    right, on_right = distance, k
        if on_left >= 0:
            count = _list(out, count, i, points[on_left])
        if on_right >= 0:
            count = _list(out, count, i, points[on_right])
    return out[:count].copy()


@njit(cache=True, error_model="numpy")
def _list(out, count, i, point):
    """Write a row; the new number of rows."""
    out[count, 0], out[count, 1], out[count, 2] = i, point[0], point[1]
    return count + 1


@njit(cache=True, error_model="numpy")
def clearance(pose: Floats, x: float, y: float, box: tuple[float, float, float]) -> tuple[float, Floats]:
    """Signed distance [m] of a point from the footprint at a pose (3,), and its gradient by the pose (3,).

    box (half_length, half_width, rounding) [m]. Inside it is minus the way out of the box's nearest side.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    px, py = cos * dx + sin * dy, cos * dy - sin * dx
    beyond_x, beyond_y = abs(px) - box[0], abs(py) - box[1]
    side_x, side_y = math.copysign(1.0, px), math.copysign(1.0, py)
    if beyond_x > 0.0 and beyond_y > 0.0:
        distance = math.hypot(beyond_x, beyond_y)
        gx, gy = side_x * beyond_x / distance, side_y * beyond_y / distance
    elif beyond_x > beyond_y:
        distance, gx, gy = beyond_x, side_x, 0.0
    else:
        distance, gx, gy = beyond_y, 0.0, side_y
    gradient = np.array([sin * gy - cos * gx, -sin * gx - cos * gy, gx * py - gy * px])
    return distance - box[2], gradient


@njit(cache=True, error_model="numpy", inline="always")
def wrapped(angle):
    """The angle in [−π, π), which mirrors everywhere but at −π [rad]."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
