"""Motion of a differential drive over one control period, and of the obstacles that move meanwhile."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Bools, Floats

WIDEST = 1.0  # [m] greatest radius of a person or another mover
_SKIN = 0.1  # [m] behind the nearest point of a mover


@njit(cache=True, error_model="numpy", inline="always")
def wrapped(angle: float) -> float:
    """Wrap an angle to [−π, π) [rad]."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@njit(cache=True)
def drive(
    pose: tuple[float, float, float],
    twist: tuple[float, float],
    command: tuple[float, float],
    limits: tuple[float, float, float, float],
    dt: float,
    max_step: float,
    reach: float,
) -> tuple[Floats, tuple[float, float]]:
    """Poses of the motion while v and ω ramp to the command, each at its own acceleration limit.

    pose (x, y, yaw), twist (v, ω), command (v, ω), limits (v_max, ω_max, α_v, α_ω). No point of a footprint
    of radius `reach` [m] moves further than `max_step` [m] between two poses.
    Returns poses (K, 3), the last one after `dt` [s], and the twist there.
    """
    v_max, omega_max, alpha_v, alpha_omega = limits
    v_goal = min(max(command[0], -v_max), v_max)
    omega_goal = min(max(command[1], -omega_max), omega_max)
    # Enough steps that no point of the footprint moves further than `max_step` in one.
    fastest = max(abs(twist[0]), abs(v_goal)) + reach * max(abs(twist[1]), abs(omega_goal))
    steps = max(1, math.ceil(fastest * dt / max_step - 1e-9))
    poses = np.empty((steps, 3))
    x, y = pose[0], pose[1]
    travelled = 0.0
    for k in range(steps):
        end_time = dt * (k + 1) / steps
        # Midpoint rule: the distance of the step is driven along the heading at its middle.
        middle = pose[2] + _ramp_integral(twist[1], omega_goal, alpha_omega, dt * (k + 0.5) / steps)
        total = _ramp_integral(twist[0], v_goal, alpha_v, end_time)
        x += (total - travelled) * math.cos(middle)
        y += (total - travelled) * math.sin(middle)
        yaw = pose[2] + _ramp_integral(twist[1], omega_goal, alpha_omega, end_time)
        travelled = total
        poses[k, 0], poses[k, 1], poses[k, 2] = x, y, yaw
    return poses, (_ramp(twist[0], v_goal, alpha_v, dt), _ramp(twist[1], omega_goal, alpha_omega, dt))


@njit(cache=True)
def even_limits(
    twist: tuple[float, float],
    command: tuple[float, float],
    limits: tuple[float, float, float, float],
    dt: float,
) -> tuple[float, float, float, float]:
    """Lower α in the limits so that v and ω change over the whole of `dt` [s], instead of at α and then holding.

    twist, command (v, ω); limits (v_max, ω_max, α_v, α_ω).
    """
    v_max, omega_max, alpha_v, alpha_omega = limits
    v = min(max(command[0], -v_max), v_max)
    omega = min(max(command[1], -omega_max), omega_max)
    # The acceleration that takes all of `dt`, unless the limit is lower; never 0, since ramps divide by it.
    alpha_v = min(alpha_v, max(abs(v - twist[0]) / dt, 1e-9))
    alpha_omega = min(alpha_omega, max(abs(omega - twist[1]) / dt, 1e-9))
    return v_max, omega_max, alpha_v, alpha_omega


@njit(cache=True)
def time_beyond(poses: Floats, start: Floats, distance: float, begin: float, end: float) -> float:
    """Time at which the first of the (K, 3) poses is at least `distance` [m] from the (2,) start [s]; NaN if none is.

    The motion lasts from `begin` to `end` [s]; the last pose is at `end`.
    """
    for k in range(len(poses)):
        if math.hypot(poses[k, 0] - start[0], poses[k, 1] - start[1]) >= distance:
            return begin + (k + 1) / len(poses) * (end - begin)
    return math.nan


@njit(cache=True)
def travelled(x: float, y: float, poses: Floats) -> float:
    """Length of the path from (x, y) through the (K, 3) poses [m]."""
    length = 0.0
    for k in range(len(poses)):
        length += math.hypot(poses[k, 0] - x, poses[k, 1] - y)
        x, y = poses[k, 0], poses[k, 1]
    return length


@njit(cache=True)
def _ramp(start: float, goal: float, rate: float, time: float) -> float:
    """Value after `time` of a quantity that ramps from start to goal at `rate` per second."""
    change = goal - start
    return start + math.copysign(min(abs(change), rate * time), change)


@njit(cache=True)
def _ramp_integral(start: float, goal: float, rate: float, time: float) -> float:
    """Integral of `_ramp` over [0, time]."""
    ramp_time = min(abs(goal - start) / rate, time)
    at_end = _ramp(start, goal, rate, ramp_time)
    return (start + at_end) / 2 * ramp_time + at_end * (time - ramp_time)


@njit(cache=True, error_model="numpy")
def movers_among(
    points: Floats, scan_points: Floats, people: Floats, max_radius: float
) -> tuple[Bools, Floats]:
    """Find the points (M, 2) that belong to movers: a mask (M,), and the movers (P, 5) with their radii [m].

    scan_points (S, 2): the current scan. people (P, 4): x, y, vx, vy of the movers' centres [m, m/s]. A mover's radius
    is the distance to the nearest point of the scan, at most `max_radius`; points up to `_SKIN` farther belong to it.
    """
    movers = np.empty((len(people), 5))
    is_mover = np.zeros(len(points), np.bool_)
    for n in range(len(people)):
        # Radius of the mover: distance from its centre to the nearest point of the scan.
        square = max_radius * max_radius
        for m in range(len(scan_points)):
            square = min(
                square, (scan_points[m, 0] - people[n, 0]) ** 2 + (scan_points[m, 1] - people[n, 1]) ** 2
            )
        movers[n, :4], movers[n, 4] = people[n], math.sqrt(square)
        # Its own points lie at most `_SKIN` beyond that radius.
        for m in range(len(points)):
            dx, dy = points[m, 0] - people[n, 0], points[m, 1] - people[n, 1]
            is_mover[m] = is_mover[m] or math.sqrt(dx * dx + dy * dy) < movers[n, 4] + _SKIN
    return is_mover, movers
