"""Errors of a timed elastic band, weighted and squared, and the normal equations of their least squares.

Variable 4 i + c is x, y, yaw of pose i (c = 0, 1, 2) or the time difference after it (c = 3). A motion between two
poses depends on seven neighbouring variables, an acceleration on eleven: the matrix has ten bands below its diagonal.
"""

import math

import numpy as np
from numba import njit

from lme.planners.teb.kernels.samples import clearance, wrapped
from lme.types import Floats

BANDS = 11  # with the diagonal
STEEPNESS = 100.0  # [1/m] of the change of sign of a speed when the robot drives backwards
_TURNS = 3  # first motions that a wanted direction of turns concerns
_TINY = 1e-12  # [m] a shorter way has no direction

Bounds = tuple[float, float, float, float, float, float, float]
Weights = tuple[float, float, float, float, float, float, float, float, float, float]


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
    for i in range(len(times)):
        total += _add(matrix, descent, 4 * i, by_time, times[i], weights[0])
        total += _limit(matrix, descent, 4 * i, by_speed[i], speeds[i], forwards, weights[1])
        total += _limit(matrix, descent, 4 * i, by_rate[i], rates[i], sideways, weights[2])
        total += _steering(matrix, descent, i, poses, weights[5:7])
        if turn != 0.0 and i < _TURNS:
            total += _turn(matrix, descent, i, poses, turn, weights[9])
    limits = (bounds[3], bounds[6])
    total += _accelerations(matrix, descent, times, speeds, by_speed, twist[0], limits, weights[3])
    limits = (bounds[4], bounds[6])
    total += _accelerations(matrix, descent, times, rates, by_rate, twist[1], limits, weights[4])
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
        ahead = STEEPNESS * (cos * dx + sin * dy)
        sign, slope = ahead / (1.0 + abs(ahead)), STEEPNESS / (1.0 + abs(ahead)) ** 2
        way = math.hypot(dx, dy)
        ux, uy = (dx / way, dy / way) if way > _TINY else (0.0, 0.0)
        speeds[i], rates[i] = sign * way / t, wrapped(poses[i + 1, 2] - poses[i, 2]) / t
        gx, gy = (sign * ux + way * slope * cos) / t, (sign * uy + way * slope * sin) / t
        by_speed[i, 0], by_speed[i, 1], by_speed[i, 4], by_speed[i, 5] = -gx, -gy, gx, gy
        by_speed[i, 2] = way * slope * (cos * dy - sin * dx) / t
        by_speed[i, 3] = -speeds[i] / t
        by_rate[i, 2], by_rate[i, 6], by_rate[i, 3] = -1.0 / t, 1.0 / t, -rates[i] / t
    return speeds, rates, by_speed, by_rate


@njit(cache=True, error_model="numpy")
def _accelerations(matrix, descent, times, speeds, by_speed, before, limits, weight):
    """Accelerations from `before` over the speeds to rest. limits: (the greatest one, epsilon)."""
    last = len(times) - 1
    interval = (-limits[0], limits[0], limits[1])
    start = by_speed[0] / times[0]
    value = (speeds[0] - before) / times[0]
    start[3] -= value / times[0]
    total = _limit(matrix, descent, 0, start, value, interval, weight)
    for i in range(last):
        row, span = np.zeros(11), 0.5 * (times[i] + times[i + 1])
        value = (speeds[i + 1] - speeds[i]) / span
        row[:7] -= by_speed[i] / span
        row[4:] += by_speed[i + 1] / span
        row[3] -= 0.5 * value / span
        row[7] -= 0.5 * value / span
        total += _limit(matrix, descent, 4 * i, row, value, interval, weight)
    end = -by_speed[last] / times[last]
    value = -speeds[last] / times[last]
    end[3] -= value / times[last]
    return total + _limit(matrix, descent, 4 * last, end, value, interval, weight)


@njit(cache=True, error_model="numpy")
def _steering(matrix, descent, i, poses, weights):
    """Both headings lie on one arc, and the motion is not backwards. weights: of both."""
    dx, dy = poses[i + 1, 0] - poses[i, 0], poses[i + 1, 1] - poses[i, 1]
    cos, sin = math.cos(poses[i, 2]), math.sin(poses[i, 2])
    cos_after, sin_after = math.cos(poses[i + 1, 2]), math.sin(poses[i + 1, 2])
    row = np.zeros(7)
    row[0], row[1] = sin + sin_after, -cos - cos_after
    row[4], row[5] = -row[0], -row[1]
    row[2], row[6] = -sin * dy - cos * dx, -sin_after * dy - cos_after * dx
    aside = (cos + cos_after) * dy - (sin + sin_after) * dx
    total = _add(matrix, descent, 4 * i, row, aside, weights[0])
    ahead = cos * dx + sin * dy
    if ahead < 0.0:
        row = np.zeros(7)
        row[0], row[1], row[2], row[4], row[5] = cos, sin, sin * dx - cos * dy, -cos, -sin
        total += _add(matrix, descent, 4 * i, row, -ahead, weights[1])
    return total


@njit(cache=True, error_model="numpy")
def _turn(matrix, descent, i, poses, turn, weight):
    """A motion does not turn against the wanted direction."""
    wrong = -turn * wrapped(poses[i + 1, 2] - poses[i, 2])
    if wrong <= 0.0:
        return 0.0
    row = np.zeros(7)
    row[2], row[6] = turn, -turn
    return _add(matrix, descent, 4 * i, row, wrong, weight)


@njit(cache=True, error_model="numpy")
def _via(matrix, descent, i, poses, point, weight):
    """Distance of pose i from a point [index, x, y]."""
    dx, dy = poses[i, 0] - point[1], poses[i, 1] - point[2]
    away = math.hypot(dx, dy)
    row = np.zeros(2)
    if away > _TINY:
        row[0], row[1] = dx / away, dy / away
    return _add(matrix, descent, 4 * i, row, away, weight)


@njit(cache=True, error_model="numpy")
def _limit(matrix, descent, first, row, value, interval, weight):
    """Error of a value with derivatives `row` beyond an interval (low, high, epsilon), tightened by epsilon."""
    low, high = value - interval[0] - interval[2], value - interval[1] + interval[2]
    if low < 0.0:
        return _add(matrix, descent, first, -row, -low, weight)
    return _add(matrix, descent, first, row, high, weight) if high > 0.0 else 0.0


@njit(cache=True, error_model="numpy")
def _add(matrix, descent, first, row, error, weight):
    """Add an error and its derivatives `row` by the variables from `first` on; the weighted square."""
    for a in range(len(row)):
        if row[a] != 0.0:
            scaled = weight * row[a]
            descent[first + a] -= scaled * error
            for b in range(a + 1):
                matrix[a - b, first + b] += scaled * row[b]
    return weight * error * error


@njit(cache=True, error_model="numpy")
def _fix(matrix, descent):
    """Keep the first and the last pose, and the time difference that does not exist."""
    size = len(descent)
    for k in range(size):
        if k < 3 or k >= size - 4:
            descent[k] = 0.0
            for d in range(BANDS):
                matrix[d, k] = 0.0
                if k - d >= 0:
                    matrix[d, k - d] = 0.0
            matrix[0, k] = 1.0
