"""Optimal reciprocal collision avoidance: permitted half-planes of velocities, and the best velocity in them.

Van den Berg, Guy, Lin and Manocha 2011, "Reciprocal n-body collision avoidance", DOI 10.1007/978-3-642-19457-3_1; the
linear programs are those of the authors' RVO2 library. A half-plane is a row [x, y, dx, dy]: a point on its border,
and the border's direction, with the permitted velocities to the left.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Floats

_PARALLEL = 1e-10  # directions (sine of the angle) and distances [m/s] below this are rounding


@njit(cache=True, error_model="numpy")
def beside_disc(relative, velocity, other_velocity, reach, horizon, dt, responsibility, line):
    """Write the half-plane of velocities that meet no disc within `horizon` [s] into `line` (4,).

    relative: (x, y) of the other disc's centre from ours [m]; velocity, other_velocity: (vx, vy) [m/s]. reach: sum of
    the radii [m]; discs that overlap must come apart within `dt` [s]. responsibility: our part of the evasion, ½ if the
    other disc does as much.
    """
    # Relative velocity, and its offset from the disc that cuts off the cone of forbidden velocities.
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
        # The nearest border is the cut-off disc: u leads straight out of it.
        if length > 0.0:
            nx, ny = wx / length, wy / length
        else:  # exactly at the middle: any side
            distance = math.sqrt(square)
            nx, ny = (-x / distance, -y / distance) if distance > 0.0 else (1.0, 0.0)
        dx, dy = ny, -nx
        depth = reach / horizon - length
        ux, uy = depth * nx, depth * ny
    else:  # beside one of the legs of the cone
        leg = math.sqrt(square - reach * reach)
        if x * wy - y * wx > 0.0:
            dx, dy = (x * leg - y * reach) / square, (x * reach + y * leg) / square
        else:
            dx, dy = -(x * leg + y * reach) / square, -(y * leg - x * reach) / square
        # u leads to the foot of the relative velocity on the leg.
        along = vx * dx + vy * dy
        ux, uy = along * dx - vx, along * dy - vy
    # Our share of u shifts the border: it passes through velocity + responsibility · u.
    line[0], line[1] = velocity[0] + responsibility * ux, velocity[1] + responsibility * uy
    line[2], line[3] = dx, dy


@njit(cache=True, error_model="numpy")
def before_point(x, y, radius, horizon, line):
    """Write the half-plane that keeps a disc off a resting point into `line` (4,).

    x, y: the point relative to the disc's centre [m]. The disc comes nearer by at most its clearance in `horizon`
    [s]. Where the point is the nearest of a convex obstacle, this keeps it off the whole obstacle. The velocity 0 is
    always permitted, also in contact.
    """
    distance = math.sqrt(x * x + y * y)
    nx, ny = (x / distance, y / distance) if distance > 0.0 else (1.0, 0.0)
    # Greatest speed towards the point; the border is perpendicular to that direction.
    max_approach = max(distance - radius, 0.0) / horizon
    line[0], line[1], line[2], line[3] = max_approach * nx, max_approach * ny, -ny, nx


@njit(cache=True, error_model="numpy")
def best_velocity(
    lines: Floats, hard: int, v_max: float, preferred: tuple[float, float]
) -> tuple[float, float]:
    """Permitted velocity nearest to the wanted one [m/s]; the wanted one is first shortened to `v_max`.

    lines (L, 4): half-planes; the first `hard` permit the velocity 0 and are never violated. If the others have no
    velocity in common, the greatest violation of any of them is made as small as possible.
    """
    x, y = preferred
    length = math.sqrt(x * x + y * y)
    if length > v_max:
        x, y = x * v_max / length, y * v_max / length
    # Meet all half-planes, or else violate the soft ones as little as possible.
    failed, x, y = _nearest(lines, len(lines), v_max, x, y, False)
    if failed < hard:  # they permit only the velocity 0, and rounding has lost it
        return 0.0, 0.0
    if failed < len(lines):
        x, y = _least_left(lines, hard, failed, v_max, x, y)
    return x, y


@njit(cache=True, error_model="numpy")
def _nearest(lines, count, v_max, x, y, far):
    """Index of the first half-plane without a solution, or `count`, and the best velocity before it.

    far: (x, y) is the direction in which to go as far as possible; otherwise it is the point to approach.
    """
    goal_x, goal_y = x, y
    if far:
        x, y = x * v_max, y * v_max
    for i in range(count):
        px, py, dx, dy = lines[i]
        # A violated half-plane has the new optimum on its border.
        if dx * (py - y) - dy * (px - x) > 0.0:
            solved, new_x, new_y = _on_border(lines, i, v_max, goal_x, goal_y, far)
            if not solved:
                return i, x, y
            x, y = new_x, new_y
    return count, x, y


@njit(cache=True, error_model="numpy")
def _on_border(lines, i, v_max, goal_x, goal_y, far):
    """Find the best velocity on the border of half-plane i that the half-planes before it permit.

    Returns whether there is one, and its vx and vy.
    """
    px, py, dx, dy = lines[i]
    # Interval of the border within the circle of radius v_max.
    middle = px * dx + py * dy
    square = middle * middle + v_max * v_max - (px * px + py * py)
    if square < 0.0:
        return False, 0.0, 0.0
    half = math.sqrt(square)
    low, high = -middle - half, -middle + half
    # Cut the interval by the earlier half-planes; a parallel one permits all of it or nothing, and where both borders
    # are the same line but for rounding, all of it.
    for j in range(i):
        qx, qy, ex, ey = lines[j]
        across = dx * ey - dy * ex
        ahead = ex * (py - qy) - ey * (px - qx)
        if abs(across) <= _PARALLEL:
            if ahead < -_PARALLEL:
                return False, 0.0, 0.0
            continue
        part = ahead / across
        if across >= 0.0:
            high = min(high, part)
        else:
            low = max(low, part)
        if low > high:
            return False, 0.0, 0.0
    # Best part of the interval: its end in the wanted direction, or its point nearest to the goal.
    if far:
        part = high if goal_x * dx + goal_y * dy > 0.0 else low
    else:
        part = min(max(dx * (goal_x - px) + dy * (goal_y - py), low), high)
    return True, px + part * dx, py + part * dy


@njit(cache=True, error_model="numpy")
def _least_left(lines, hard, begin, v_max, x, y):
    """Velocity with the least greatest violation of the soft half-planes.

    (x, y): the best velocity that the half-planes before `begin` permit.
    """
    distance = 0.0
    bisectors = np.empty_like(lines)
    bisectors[:hard] = lines[:hard]
    for i in range(begin, len(lines)):
        px, py, dx, dy = lines[i]
        # Skip half-planes that are violated no more than the worst one so far.
        if dx * (py - y) - dy * (px - x) <= distance:
            continue
        # Bisectors: velocities that violate an earlier half-plane j no more than half-plane i.
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
        # Go as far as possible to the permitted side of half-plane i.
        failed, new_x, new_y = _nearest(bisectors, count, v_max, -dy, dx, True)
        if failed == count:  # else rounding alone is to blame: the former velocity is still the best
            x, y = new_x, new_y
        distance = dx * (py - y) - dy * (px - x)
    return x, y
