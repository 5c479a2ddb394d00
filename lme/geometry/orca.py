"""Optimal reciprocal collision avoidance: permitted half-planes of velocities, and the best velocity in them.

Van den Berg, Guy, Lin and Manocha 2011, "Reciprocal n-body collision avoidance", DOI 10.1007/978-3-642-19457-3_1; the
linear programs are those of the authors' RVO2 library. A half-plane is a row [x, y, dx, dy]: a point on its border, and
the border's direction, with the permitted velocities to the left.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Floats

_PARALLEL = 1e-10


@njit(cache=True, error_model="numpy")
def beside_disc(relative, velocity, other_velocity, reach, horizon, dt, share, line):
    """Write the half-plane in which no disc is met within `horizon` [s] into `line` (4,).

    relative: (x, y) of the other disc's centre from ours [m]; velocity, other_velocity: (vx, vy) [m/s]. reach: sum
    of the radii [m]; discs that overlap must come apart within `dt` [s]. share: of the evasion that is ours, ½ if
    the other does as much.
    """
    vx, vy = velocity[0] - other_velocity[0], velocity[1] - other_velocity[1]
    x, y = relative[0], relative[1]
    square = x * x + y * y
    if square <= reach * reach:
        horizon = dt
    wx, wy = (
        vx - x / horizon,
        vy - y / horizon,
    )  # from the middle of the cut-off disc to the relative velocity
    length = math.sqrt(wx * wx + wy * wy)
    ahead = wx * x + wy * y
    if square <= reach * reach or (ahead < 0.0 and ahead * ahead > reach * reach * length * length):
        if length > 0.0:
            nx, ny = wx / length, wy / length
        else:  # exactly at the middle: any side
            away = math.sqrt(square)
            nx, ny = (-x / away, -y / away) if away > 0.0 else (1.0, 0.0)
        dx, dy = ny, -nx
        depth = reach / horizon - length
        ux, uy = depth * nx, depth * ny
    else:  # beside one of the legs of the cone
        leg = math.sqrt(square - reach * reach)
        if x * wy - y * wx > 0.0:
            dx, dy = (x * leg - y * reach) / square, (x * reach + y * leg) / square
        else:
            dx, dy = -(x * leg + y * reach) / square, -(y * leg - x * reach) / square
        along = vx * dx + vy * dy
        ux, uy = along * dx - vx, along * dy - vy
    line[0], line[1] = velocity[0] + share * ux, velocity[1] + share * uy
    line[2], line[3] = dx, dy


@njit(cache=True, error_model="numpy")
def before_point(x, y, radius, horizon, line):
    """Write the half-plane that keeps a disc off a resting point into `line` (4,).

    x, y: the point from the disc's centre [m]. The disc comes nearer by at most its clearance in `horizon` [s]. Where
    the point is the nearest of a convex obstacle, this keeps it off the whole obstacle. The velocity 0 is always
    permitted, also in contact.
    """
    away = math.sqrt(x * x + y * y)
    nx, ny = (x / away, y / away) if away > 0.0 else (1.0, 0.0)
    most = max(away - radius, 0.0) / horizon
    line[0], line[1], line[2], line[3] = most * nx, most * ny, -ny, nx


@njit(cache=True, error_model="numpy")
def best_velocity(lines: Floats, hard: int, v_max: float, wanted: tuple[float, float]) -> tuple[float, float]:
    """The permitted velocity nearest to the wanted one [m/s], which is shortened to `v_max` before.

    lines (L, 4): half-planes; the first `hard` permit the velocity 0 and are never left. If the others have nothing in
    common, they are left by as little as possible, all together.
    """
    x, y = wanted
    length = math.sqrt(x * x + y * y)
    if length > v_max:
        x, y = x * v_max / length, y * v_max / length
    failed, x, y = _nearest(lines, len(lines), v_max, x, y, False)
    if failed < hard:  # they leave the velocity 0 alone, and rounding has taken that
        return 0.0, 0.0
    if failed < len(lines):
        x, y = _least_left(lines, hard, failed, v_max, x, y)
    return x, y


@njit(cache=True, error_model="numpy")
def _nearest(lines, count, v_max, x, y, far):
    """Index of the first half-plane without a solution, or `count`; the velocity that the others permit.

    far: (x, y) is a direction to go as far as possible, else a point to come near to.
    """
    goal_x, goal_y = x, y
    if far:
        x, y = x * v_max, y * v_max
    for i in range(count):
        px, py, dx, dy = lines[i]
        if dx * (py - y) - dy * (px - x) > 0.0:
            solved, new_x, new_y = _on_border(lines, i, v_max, goal_x, goal_y, far)
            if not solved:
                return i, x, y
            x, y = new_x, new_y
    return count, x, y


@njit(cache=True, error_model="numpy")
def _on_border(lines, i, v_max, goal_x, goal_y, far):
    """Whether the half-planes before i leave something of the border of half-plane i, and the best of it."""
    px, py, dx, dy = lines[i]
    middle = px * dx + py * dy
    square = middle * middle + v_max * v_max - (px * px + py * py)
    if square < 0.0:
        return False, 0.0, 0.0
    half = math.sqrt(square)
    low, high = -middle - half, -middle + half
    for j in range(i):
        qx, qy, ex, ey = lines[j]
        across = dx * ey - dy * ex
        ahead = ex * (py - qy) - ey * (px - qx)
        if abs(across) <= _PARALLEL:
            if ahead < 0.0:
                return False, 0.0, 0.0
            continue
        part = ahead / across
        if across >= 0.0:
            high = min(high, part)
        else:
            low = max(low, part)
        if low > high:
            return False, 0.0, 0.0
    if far:
        part = high if goal_x * dx + goal_y * dy > 0.0 else low
    else:
        part = min(max(dx * (goal_x - px) + dy * (goal_y - py), low), high)
    return True, px + part * dx, py + part * dy


@njit(cache=True, error_model="numpy")
def _least_left(lines, hard, begin, v_max, x, y):
    """The velocity that leaves the soft half-planes from `begin` on by the least greatest distance."""
    distance = 0.0
    bisectors = np.empty_like(lines)
    bisectors[:hard] = lines[:hard]
    for i in range(begin, len(lines)):
        px, py, dx, dy = lines[i]
        if dx * (py - y) - dy * (px - x) <= distance:
            continue
        count = hard
        for j in range(hard, i):
            qx, qy, ex, ey = lines[j]
            across = dx * ey - dy * ex
            if abs(across) <= _PARALLEL:
                if dx * ex + dy * ey > 0.0:
                    continue
                bisectors[count, 0], bisectors[count, 1] = 0.5 * (px + qx), 0.5 * (py + qy)
            else:
                part = (ex * (py - qy) - ey * (px - qx)) / across
                bisectors[count, 0], bisectors[count, 1] = px + part * dx, py + part * dy
            turn_x, turn_y = ex - dx, ey - dy
            length = math.sqrt(turn_x * turn_x + turn_y * turn_y)
            bisectors[count, 2], bisectors[count, 3] = turn_x / length, turn_y / length
            count += 1
        failed, new_x, new_y = _nearest(bisectors, count, v_max, -dy, dx, True)
        if failed == count:  # else rounding alone is to blame: the former velocity is still the best
            x, y = new_x, new_y
        distance = dx * (py - y) - dy * (px - x)
    return x, y
