"""Samples of a timed elastic band, its weighted errors, and the normal equations of their least squares.

A band is poses (N, 3) [m, m, rad] and the time differences (N − 1,) [s] between them. It is made along a path, and
samples are added and removed.

Variable 4 i + c is x, y, yaw of pose i (c = 0, 1, 2) or the time difference after it (c = 3). A motion between two
poses depends on seven neighbouring variables, an acceleration on eleven: the matrix has ten bands below its diagonal.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Floats

_PASSES = 100  # of `resized`, at most, as in teb_local_planner
BANDS = 11  # with the diagonal
STEEPNESS = 100.0  # [1/m] of the change of sign of a speed when the robot drives backwards
_TURNS = 3  # first motions that a wanted direction of turns concerns
_TINY = 1e-12  # [m] a shorter way has no direction
Bounds = tuple[float, float, float, float, float, float, float]
Weights = tuple[float, float, float, float, float, float, float, float, float, float]


@njit(cache=True, error_model="numpy")
def along(
    path: Floats, start: tuple[float, float, float], yaw: float, v_max: float, omega_max: float
) -> tuple[Floats, Floats]:
    """Band from `start` along the path (P, 2), P ≥ 1, to its end with heading `yaw`, as fast as the limits allow.

    It has a pose at each point of the path, heading for the next one, and one half-way if P = 1.
    """
    line = path if len(path) > 1 else np.vstack((0.5 * (path + np.array([[start[0], start[1]]])), path))
    count = len(line) + 1
    poses = np.empty((count, 3))
    poses[0] = start
    for k in range(1, count):
        # Each pose heads for the next point; the last one takes the given heading.
        poses[k, :2] = line[k - 1]
        poses[k, 2] = yaw
        if k < count - 1:
            poses[k, 2] = math.atan2(line[k, 1] - line[k - 1, 1], line[k, 0] - line[k - 1, 0])
    # Least time for each motion: the greater of its way at v_max and its turn at omega_max.
    times = np.empty(count - 1)
    for k in range(count - 1):
        distance = math.hypot(poses[k + 1, 0] - poses[k, 0], poses[k + 1, 1] - poses[k, 1])
        turn = abs(wrapped(poses[k + 1, 2] - poses[k, 2]))
        times[k] = max(distance / v_max, turn / omega_max, 1e-3)
    return poses, times


@njit(cache=True, error_model="numpy")
def resized(
    poses: Floats, times: Floats, interval: float, hysteresis: float, fewest: int, max_samples: int
) -> tuple[Floats, Floats]:
    """Add and remove samples so that the time differences of the band are near `interval` [s].

    hysteresis [s]: the greatest deviation from it. `fewest`, `max_samples`: limits of the number of time differences.
    """
    size = max(max_samples, len(times)) + 1
    p, t = np.empty((size, 3)), np.empty(size)
    count = len(times)
    p[: count + 1], t[:count] = poses, times
    for _ in range(_PASSES):
        modified, i = False, 0
        while i < count:
            # Too long: split a difference of more than twice the wanted one, else hand the surplus on to the next.
            # Too short: merge the motion with its neighbour.
            if t[i] > interval + hysteresis and count < max_samples:
                if t[i] > 2.0 * interval:
                    count = _split(p, t, count, i)
                    modified = True
                    continue  # looks at the first half again
                if i < count - 1:
                    t[i + 1] += t[i] - interval
                t[i] = interval
            elif t[i] < interval - hysteresis and count > fewest:
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
    """Add a pose half-way between poses i and i + 1; return the new number of time differences."""
    for k in range(count, i, -1):
        p[k + 1], t[k] = p[k], t[k - 1]
    p[i + 1, :2] = 0.5 * (p[i, :2] + p[i + 2, :2])
    p[i + 1, 2] = wrapped(p[i, 2] + 0.5 * wrapped(p[i + 2, 2] - p[i, 2]))
    t[i] *= 0.5
    t[i + 1] = t[i]
    return count + 1


@njit(cache=True, error_model="numpy")
def _merge(p, t, count, i):
    """Remove the pose after difference i, or before the last one; return the new number of differences."""
    removed = i if i < count - 1 else i - 1
    t[removed + 1] += t[removed]
    for k in range(removed, count - 1):
        t[k] = t[k + 1]
    for k in range(removed + 1, count):
        p[k] = p[k + 1]
    return count - 1


@njit(cache=True, error_model="numpy")
def near_obstacles(
    poses: Floats, points: Floats, box: tuple[float, float, float], always: float, never: float
) -> Floats:
    """Select the points (M, 2) [m] that count at each pose: (K, 3) [index of the pose, x, y].

    At each pose but the first and the last, these are all points nearer than `always` to the footprint `box`, and of
    the others up to `never` the nearest one on its left and on its right [m].
    """
    rows = np.empty((len(poses) * (len(points) + 2), 3))
    reach = never + math.hypot(box[0], box[1]) + box[2]
    count = 0
    for i in range(1, len(poses) - 1):
        left, right, on_left, on_right = np.inf, np.inf, -1, -1
        for k in range(len(points)):
            # A cheap test by the circumscribed circle comes first.
            dx, dy = points[k, 0] - poses[i, 0], points[k, 1] - poses[i, 1]
            if dx * dx + dy * dy > reach * reach:
                continue
            # Very near points all count; of the others only the nearest one on either side.
            distance = clearance(poses[i], points[k, 0], points[k, 1], box)[0]
            if distance < always:
                count = _list(rows, count, i, points[k])
            elif distance <= never:
                if math.cos(poses[i, 2]) * dy - math.sin(poses[i, 2]) * dx > 0.0:
                    if distance < left:
                        left, on_left = distance, k
                elif distance < right:
                    right, on_right = distance, k
        if on_left >= 0:
            count = _list(rows, count, i, points[on_left])
        if on_right >= 0:
            count = _list(rows, count, i, points[on_right])
    return rows[:count].copy()


@njit(cache=True, error_model="numpy")
def _list(rows, count, i, point):
    """Write a row; return the new number of rows."""
    rows[count, 0], rows[count, 1], rows[count, 2] = i, point[0], point[1]
    return count + 1


@njit(cache=True, error_model="numpy")
def clearance(pose: Floats, x: float, y: float, box: tuple[float, float, float]) -> tuple[float, Floats]:
    """Signed distance [m] of a point from the footprint at a pose (3,), and its gradient by the pose (3,).

    box (half_length, half_width, rounding) [m]. Inside, it is minus the distance to the nearest side of the box.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    # The point in the frame of the footprint, and how far it is beyond the sides of the box.
    px, py = cos * dx + sin * dy, cos * dy - sin * dx
    beyond_x, beyond_y = abs(px) - box[0], abs(py) - box[1]
    side_x, side_y = math.copysign(1.0, px), math.copysign(1.0, py)
    # Nearest part of the box: a corner, the front or rear side, or the left or right side.
    if beyond_x > 0.0 and beyond_y > 0.0:
        distance = math.hypot(beyond_x, beyond_y)
        gx, gy = side_x * beyond_x / distance, side_y * beyond_y / distance
    elif beyond_x > beyond_y:
        distance, gx, gy = beyond_x, side_x, 0.0
    else:
        distance, gx, gy = beyond_y, 0.0, side_y
    # Chain rule, by x, y and yaw of the pose.
    gradient = np.array([sin * gy - cos * gx, -sin * gx - cos * gy, gx * py - gy * px])
    return distance - box[2], gradient


@njit(cache=True, error_model="numpy", inline="always")
def wrapped(angle):
    """Wrap an angle to [−π, π), symmetrically everywhere but at −π [rad]."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@njit(cache=True, error_model="numpy")
def normal_equations(
    poses: Floats,
    times: Floats,
    twist: tuple[float, float],
    near: Floats,
    via: Floats,
    turn: float,
    box: tuple[float, float, float],
    bounds: Bounds,
    weights: Weights,
) -> tuple[float, Floats, Floats]:
    """Sum of the squared errors of a band, its Gauss–Newton matrix (11, 4 N) and its steepest descent (4 N,).

    poses (N, 3), N ≥ 3, times (N − 1,); twist: (v, ω) before the band, which ends at rest. near (K, 3) and via (V, 3):
    [index of a pose, x, y] of obstacles and of points to pass. turn: 1 left, -1 right, 0 any. box: the footprint.
    bounds: (fastest backwards, fastest [m/s], turn rate [rad/s], accelerations [m/s², rad/s²], clearance [m],
    epsilon), limits are tightened by epsilon. weights: of (time, velocity, turn rate, acceleration, angular
    acceleration, nonholonomic motion, driving backwards, obstacles, points to pass, turns the other way).
    Row d, column j of the matrix is element (j + d, j), as in scipy.linalg.solveh_banded. Both ends are fixed.
    """
    matrix, descent = np.zeros((BANDS, 4 * len(poses))), np.zeros(4 * len(poses))
    speeds, rates, by_speed, by_rate = _motions(poses, times)
    forwards, sideways = (-bounds[0], bounds[1], bounds[6]), (-bounds[2], bounds[2], bounds[6])
    by_time = np.array([0.0, 0.0, 0.0, 1.0])
    total = 0.0
    # Errors of each motion: time, speed, turn rate, arc, and direction of the turn.
    for i in range(len(times)):
        total += _add(matrix, descent, 4 * i, by_time, times[i], weights[0])
        total += _limit(matrix, descent, 4 * i, by_speed[i], speeds[i], forwards, weights[1])
        total += _limit(matrix, descent, 4 * i, by_rate[i], rates[i], sideways, weights[2])
        total += _steering(matrix, descent, i, poses, weights[5:7])
        if turn != 0.0 and i < _TURNS:
            total += _turn(matrix, descent, i, poses, turn, weights[9])
    # Accelerations and angular accelerations, from the current twist to rest.
    limits = (bounds[3], bounds[6])
    total += _accelerations(matrix, descent, times, speeds, by_speed, twist[0], limits, weights[3])
    limits = (bounds[4], bounds[6])
    total += _accelerations(matrix, descent, times, rates, by_rate, twist[1], limits, weights[4])
    # Clearance missing at obstacles, and distances from the points to pass.
    for k in range(len(near)):
        i = int(near[k, 0])
        distance, row = clearance(poses[i], near[k, 1], near[k, 2], box)
        missing = bounds[5] + bounds[6] - distance
        if missing > 0.0:
            total += _add(matrix, descent, 4 * i, -row, missing, weights[7])
    for k in range(len(via)):
        total += _via(matrix, descent, int(via[k, 0]), poses, via[k], weights[8])
    _fix(matrix, descent)
    return total, matrix, descent


@njit(cache=True, error_model="numpy")
def _motions(poses, times):
    """Speeds and turn rates (M,) between the poses, and their derivatives (M, 7) by the variables from pose i on."""
    count = len(times)
    speeds, rates = np.empty(count), np.empty(count)
    by_speed, by_rate = np.zeros((count, 7)), np.zeros((count, 7))
    for i in range(count):
        dx, dy, t = poses[i + 1, 0] - poses[i, 0], poses[i + 1, 1] - poses[i, 1], times[i]
        cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        # The sign of the speed is smooth, s(a) = a / (1 + |a|), so that it has a derivative at standstill.
        ahead = STEEPNESS * (cos * dx + sin * dy)
        sign, slope = ahead / (1.0 + abs(ahead)), STEEPNESS / (1.0 + abs(ahead)) ** 2
        distance = math.hypot(dx, dy)
        ux, uy = (dx / distance, dy / distance) if distance > _TINY else (0.0, 0.0)
        speeds[i], rates[i] = sign * distance / t, wrapped(poses[i + 1, 2] - poses[i, 2]) / t
        # Derivatives by (x, y, yaw, time) of pose i and by (x, y, yaw) of the next one.
        gx, gy = (sign * ux + distance * slope * cos) / t, (sign * uy + distance * slope * sin) / t
        by_speed[i, 0], by_speed[i, 1], by_speed[i, 4], by_speed[i, 5] = -gx, -gy, gx, gy
        by_speed[i, 2] = distance * slope * (cos * dy - sin * dx) / t
        by_speed[i, 3] = -speeds[i] / t
        by_rate[i, 2], by_rate[i, 6], by_rate[i, 3] = -1.0 / t, 1.0 / t, -rates[i] / t
    return speeds, rates, by_speed, by_rate


@njit(cache=True, error_model="numpy")
def _accelerations(matrix, descent, times, speeds, by_speed, initial, limits, weight):
    """Add the errors of accelerations from `initial` over the speeds to rest. limits: (the greatest one, epsilon)."""
    last_motion = len(times) - 1
    interval = (-limits[0], limits[0], limits[1])
    # From the speed before the band to that of the first motion.
    start = by_speed[0] / times[0]
    value = (speeds[0] - initial) / times[0]
    start[3] -= value / times[0]
    total = _limit(matrix, descent, 0, start, value, interval, weight)
    for i in range(last_motion):
        # Between motions: a = (v_{i+1} − v_i) / ((t_i + t_{i+1}) / 2), and its derivatives by 11 variables.
        row, span = np.zeros(11), 0.5 * (times[i] + times[i + 1])
        value = (speeds[i + 1] - speeds[i]) / span
        row[:7] -= by_speed[i] / span
        row[4:] += by_speed[i + 1] / span
        row[3] -= 0.5 * value / span
        row[7] -= 0.5 * value / span
        total += _limit(matrix, descent, 4 * i, row, value, interval, weight)
    # From the last motion to rest.
    end = -by_speed[last_motion] / times[last_motion]
    value = -speeds[last_motion] / times[last_motion]
    end[3] -= value / times[last_motion]
    return total + _limit(matrix, descent, 4 * last_motion, end, value, interval, weight)


@njit(cache=True, error_model="numpy")
def _steering(matrix, descent, i, poses, weights):
    """Add the errors of headings that are not on one arc, and of driving backwards. weights: of both."""
    dx, dy = poses[i + 1, 0] - poses[i, 0], poses[i + 1, 1] - poses[i, 1]
    cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
    cos_after, sin_after = math.cos(poses[i + 1, 2]), math.sin(poses[i + 1, 2])
    # Both headings make the same angle with the chord d if (h_i + h_{i+1}) × d = 0.
    row = np.zeros(7)
    row[0], row[1] = sin + sin_after, -cos - cos_after
    row[4], row[5] = -row[0], -row[1]
    row[2], row[6] = -sin * dy - cos * dx, -sin_after * dy - cos_after * dx
    arc_error = (cos + cos_after) * dy - (sin + sin_after) * dx
    total = _add(matrix, descent, 4 * i, row, arc_error, weights[0])
    # Driving backwards costs by the way that is driven against the heading.
    ahead = cos * dx + sin * dy
    if ahead < 0.0:
        row = np.zeros(7)
        row[0], row[1], row[2], row[4], row[5] = cos, sin, sin * dx - cos * dy, -cos, -sin
        total += _add(matrix, descent, 4 * i, row, -ahead, weights[1])
    return total


@njit(cache=True, error_model="numpy")
def _turn(matrix, descent, i, poses, turn, weight):
    """Add the error of a motion that turns against the wanted direction."""
    wrong = -turn * wrapped(poses[i + 1, 2] - poses[i, 2])
    if wrong <= 0.0:
        return 0.0
    row = np.zeros(7)
    row[2], row[6] = turn, -turn
    return _add(matrix, descent, 4 * i, row, wrong, weight)


@njit(cache=True, error_model="numpy")
def _via(matrix, descent, i, poses, point, weight):
    """Add the error of pose i: its distance from a point [index, x, y]."""
    dx, dy = poses[i, 0] - point[1], poses[i, 1] - point[2]
    distance = math.hypot(dx, dy)
    row = np.zeros(2)
    if distance > _TINY:
        row[0], row[1] = dx / distance, dy / distance
    return _add(matrix, descent, 4 * i, row, distance, weight)


@njit(cache=True, error_model="numpy")
def _limit(matrix, descent, first, row, value, interval, weight):
    """Add the error of a value, with derivatives `row`, beyond (low, high, epsilon), tightened by epsilon."""
    low, high = value - interval[0] - interval[2], value - interval[1] + interval[2]
    if low < 0.0:
        return _add(matrix, descent, first, -row, -low, weight)
    return _add(matrix, descent, first, row, high, weight) if high > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _add(matrix, descent, first, row, error, weight):
    """Add an error and its derivatives `row` by the variables from `first` on; return the weighted square."""
    for a in range(len(row)):
        if row[a] != 0.0:
            scaled = weight * row[a]
            descent[first + a] -= scaled * error
            for b in range(a + 1):
                matrix[a - b, first + b] += scaled * row[b]
    return weight * error * error


@njit(cache=True, error_model="numpy")
def _fix(matrix, descent):
    """Fix the first and the last pose, and the time difference after the last pose, which does not exist."""
    size = len(descent)
    for k in range(size):
        if k < 3 or k >= size - 4:
            descent[k] = 0.0
            for d in range(BANDS):
                matrix[d, k] = 0.0
                if k - d >= 0:
                    matrix[d, k - d] = 0.0
            matrix[0, k] = 1.0
