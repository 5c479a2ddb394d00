"""Times of a solved grid (`travel_time`) at places between its cells, and the way down to the target."""

import math

import numpy as np
from numba import njit

from lme.policies.lme_plus.kernels.travel_grid import Grid, GridNumbers
from lme.types import Floats


@njit(cache=True, error_model="numpy")
def rest_at(
    times: Floats,
    places: Floats,
    pose: tuple[float, float, float],
    grid: Grid | GridNumbers,
    robot_time: float,
    beyond: float,
    here: Floats,
    target: Floats,
    v_max: float,
) -> Floats:
    """T at the (N, 2) places in the frame at `pose` [s]: (N,). Elsewhere than searched, the least possible.

    The search ended `beyond` [s] after the time of the robot, which is at `here` (2,). If that is inf, such places
    have the time of the straight line to the target (2,), at v_max [m/s].
    """
    places = _placed(places, pose)
    out = times_at(times, places, grid)
    known = robot_time < np.inf
    for n in range(len(places)):
        if out[n] == np.inf:
            apart = here if known else target
            dx, dy = places[n, 0] - apart[0], places[n, 1] - apart[1]
            straight = math.sqrt(dx * dx + dy * dy) / v_max
            out[n] = max(robot_time + beyond - straight, 0.0) if known else straight
    return out


@njit(cache=True, error_model="numpy")
def _placed(places, pose):
    """The places in the frame of the pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    out = np.empty(places.shape)
    for n in range(len(places)):
        x, y = places[n, 0], places[n, 1]
        out[n, 0], out[n, 1] = pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y
    return out


@njit(cache=True, error_model="numpy")
def times_at(times: Floats, places: Floats, grid: Grid | GridNumbers) -> Floats:
    """T at the (N, 2) places by bilinear interpolation of the cells that have one [s]: (N,); inf if none has."""
    low_x, low_y, cell, size = grid
    out = np.full(len(places), np.inf)
    for n in range(len(places)):
        x = min(max((places[n, 0] - low_x) / cell + 0.5, 1.0), size - 1e-9)
        y = min(max((places[n, 1] - low_y) / cell + 0.5, 1.0), size - 1e-9)
        i, j = int(x), int(y)
        total, weights = 0.0, 0.0
        for a in range(2):
            for b in range(2):
                time = times[i + a, j + b]
                if time < np.inf:
                    weight = (x - i if a else i + 1 - x) * (y - j if b else j + 1 - y)
                    total += weight * time
                    weights += weight
        if weights > 0.0:
            out[n] = total / weights
    return out


@njit(cache=True, error_model="numpy")
def descend(
    times: Floats, pose: tuple[float, float, float], grid: Grid | GridNumbers, length: float, every: int
) -> Floats:
    """Places on the way of steepest descent of T, one per `every` cells, in the frame at the pose: (K, 2) [m].

    The way goes from the pose's cell to cell, for at most `length` [m].
    """
    low_x, low_y, cell, size = grid
    i = min(max(int((pose[0] - low_x) / cell) + 1, 1), size)
    j = min(max(int((pose[1] - low_y) / cell) + 1, 1), size)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    most = int(length / cell)
    places = np.empty((most // every + 1, 2))
    count = 0
    for k in range(1, most + 1):
        steepest, di, dj = 0.0, 0, 0
        for a in range(-1, 2):
            for b in range(-1, 2):
                fall = (times[i, j] - times[i + a, j + b]) / math.sqrt(max(a * a + b * b, 1))
                if fall > steepest:
                    steepest, di, dj = fall, a, b
        if di == 0 and dj == 0:
            break
        i, j = i + di, j + dj
        if k % every == 0:
            x, y = low_x + (i - 0.5) * cell - pose[0], low_y + (j - 0.5) * cell - pose[1]
            places[count, 0], places[count, 1] = cos * x + sin * y, cos * y - sin * x
            count += 1
    return places[:count]
