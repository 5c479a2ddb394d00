"""Least distance between the outline and obstacle points until a braking robot is at rest.

The motion is that of `sim=fast`: v and ω ramp to each command at their own limits (`lme.geometry.motion.drive`), and a
drive with a lag approaches it with a time constant. A state is the points, the twist and the commands under way. It
can be stopped if the commands under way, and then commands that ramp to zero until it stands, lead to no contact.
After one period of them the rest of the same motion remains, so a state that can be stopped leads to another one.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.motion import drive
from lme.types import Floats

_STEP = 0.02  # [m] no point of the outline moves further between two poses
_LAG_STEP = 0.01  # [s] in which a lag is followed, as in `sim=fast`
_REST_DISTANCE = 1e-4  # [m] a robot with a lag stands if its outline has no further than this to go


class StoppingMotion(NamedTuple):
    """Response of a robot to commands: limits (v_max, ω_max, α_v, α_ω), control period, late and lag [s].

    A command takes effect `late` before a whole number of periods has passed, 0 ≤ late < period. `lag`: time constant
    with which v and ω then approach it.
    """

    limits: tuple[float, float, float, float]
    period: float
    late: float = 0.0
    lag: float = 0.0


class _State(NamedTuple):
    """Pose [m, rad] and twist [m/s, rad/s] on the way, and the clearance up to here [m]."""

    x: float
    y: float
    yaw: float
    v: float
    omega: float
    clearance: float


@njit(cache=True, error_model="numpy")
def stopping_clearances(
    points: Floats,
    twist: tuple[float, float],
    sent: Floats,
    candidates: Floats,
    motion: StoppingMotion | tuple[tuple[float, float, float, float], float, float, float],
    box: tuple[float, float, float],
    sufficient: float,
) -> Floats:
    """Least distance from outline to points with each command for a period and then braking to rest [m].

    points (M, 2) in the robot frame [m]; twist (v, ω) now; sent (L, 2): v and ω of the commands that were sent
    and act before the next one, the oldest first; candidates (N, 2): commands [m/s, rad/s]; box: footprint
    (half_length, half_width, rounding) [m]. Returns (N,) distances, at most `sufficient` > 0 [m], and 0 for contact.
    Commands after the first one that keeps `sufficient` are not examined and have NaN.
    """
    limits, period, delay, lag = motion
    stopping_motion = StoppingMotion(limits, period, delay, lag)
    r_max = math.hypot(box[0], box[1]) + box[2]
    # Keep only points that the robot may reach before it stands.
    nearby = _points_within(points, r_max + sufficient + _farthest(twist, sent, candidates, stopping_motion))
    # Motion until the commands under way have acted; it is the same for all candidates.
    state = _State(0.0, 0.0, 0.0, twist[0], twist[1], sufficient)
    state = _follow(nearby, state, sent, True, stopping_motion, box, r_max)
    clearances = np.full(len(candidates), np.nan)
    for n in range(len(candidates)):
        # The candidate for one period, and then braking to rest.
        end_state = _follow(nearby, state, candidates[n : n + 1], len(sent) == 0, stopping_motion, box, r_max)
        clearances[n] = _brake(
            nearby, end_state, (candidates[n, 0], candidates[n, 1]), stopping_motion, box, r_max
        )
        if clearances[n] >= sufficient:
            break
    return clearances


@njit(cache=True, error_model="numpy")
def _farthest(twist, sent, candidates, motion):
    """Greatest distance that the base may drive [m]."""
    top = abs(twist[0])
    for commands in (sent, candidates):
        for n in range(len(commands)):
            top = max(top, min(abs(commands[n, 0]), motion.limits[0]))
    commanded = (len(sent) + 2) * motion.period
    return top * (commanded + motion.lag + 0.5 * top / motion.limits[2])


@njit(cache=True, error_model="numpy")
def _points_within(points, reach):
    """Points within reach of the origin (M, 2)."""
    nearby, count = np.empty(points.shape), 0
    for i in range(len(points)):
        nearby[count] = points[i]
        count += points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1] <= reach * reach
    return nearby[:count]


@njit(cache=True, error_model="numpy")
def _follow(nearby, state, commands, first, motion, box, r_max):
    """Return the state after commands (N, 2), each for a period; first: only its rest is left for the first one.

    Commands change `late` before a period ends. The motion is divided at both times, so that it is the same when it
    is computed one period later.
    """
    for n in range(len(commands)):
        command = (commands[n, 0], commands[n, 1])
        if motion.late > 0.0 and not (first and n == 0):
            state = _move(nearby, state, command, motion.late, motion, box, r_max)
        state = _move(nearby, state, command, motion.period - motion.late, motion, box, r_max)
    return state


@njit(cache=True, error_model="numpy")
def _brake(nearby, state, command, motion, box, r_max):
    """Return the least distance until the robot is at rest, with commands that ramp from this one to zero."""
    slower = np.array([command])
    while state.clearance > 0.0 and (slower.any() or _moves(state, motion, r_max)):
        for k in range(2):
            change = motion.limits[2 + k] * motion.period
            slower[0, k] -= min(max(slower[0, k], -change), change)
        state = _follow(nearby, state, slower, False, motion, box, r_max)
    return state.clearance


@njit(cache=True, error_model="numpy")
def _moves(state, motion, r_max):
    """Return whether the robot is still moving noticeably."""
    speed = abs(state.v) + r_max * abs(state.omega)
    return speed > 0.0 and (motion.lag == 0.0 or speed * motion.lag > _REST_DISTANCE)


@njit(cache=True, error_model="numpy")
def _move(nearby, state, command, duration, motion, box, r_max):
    """Return the state after a command has acted for `duration` [s]; unchanged after contact."""
    # With lag, short steps, in each of which the velocity keeps e^(−dt/τ) of its distance from the command.
    steps = max(math.ceil(duration / _LAG_STEP - 1e-9), 1) if motion.lag > 0.0 else 1
    dt = duration / steps
    decay = math.exp(-dt / motion.lag) if motion.lag > 0.0 else 0.0
    pose, twist, clearance = (state.x, state.y, state.yaw), (state.v, state.omega), state.clearance
    v = min(max(command[0], -motion.limits[0]), motion.limits[0])
    omega = min(max(command[1], -motion.limits[1]), motion.limits[1])
    for _ in range(steps):
        if clearance <= 0.0:
            break
        # First-order lag: y ← u + e^(−dt/τ) (y − u).
        reached = (v + decay * (twist[0] - v), omega + decay * (twist[1] - omega))
        poses, twist = drive(pose, twist, reached, motion.limits, dt, _STEP, r_max)
        clearance = _clearance(poses, nearby, box, clearance)
        pose = (poses[-1, 0], poses[-1, 1], poses[-1, 2])
    return _State(pose[0], pose[1], pose[2], twist[0], twist[1], clearance)


@njit(cache=True, error_model="numpy")
def _clearance(poses, nearby, box, limit):
    """Least distance from the outline at any of the (K, 3) poses to a point, or `limit` if that is less; 0: contact."""
    half_length, half_width, rounding = box
    # Compare squared distances to the box without its rounding; the root comes last.
    start_square = (limit + rounding) * (limit + rounding)
    square = start_square
    for k in range(len(poses)):
        x, y, cos, sin = poses[k, 0], poses[k, 1], math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(len(nearby)):
            # Distance of the point beyond the sides of the box, in the robot frame.
            dx, dy = nearby[i, 0] - x, nearby[i, 1] - y
            along = max(abs(cos * dx + sin * dy) - half_length, 0.0)
            across = max(abs(cos * dy - sin * dx) - half_width, 0.0)
            square = min(square, along * along + across * across)
    return max(math.sqrt(square) - rounding, 0.0) if square < start_square else limit
