"""The command that brings a robot to a subgoal in the least expected time and can still stop in time."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.kernels.arcs import first_contacts
from lme.kernels.straight_ways import KEPT
from lme.types import Floats

_HOLDS = 5  # number of times for which a command is tried, from one period to the horizon


class Estimate(NamedTuple):
    """How the time to a subgoal is estimated. Times [s], v_max [m/s].

    A command is held for some time up to `horizon`. Then the robot turns to the subgoal, which takes `turn` [s/rad], and
    drives there at v_max. `slow`: added for a command of speed 0, in proportion less for faster ones.
    """

    v_max: float
    turn: float
    period: float
    horizon: float
    slow: float


class Safety(NamedTuple):
    """What makes a command safe.

    Along its arc the outline, grown by margin + margin_time · (v + r_max |ω|), touches no point for one period and the time
    to stop, at `brake` [m/s²] and alpha_omega [rad/s²]. v · |ω| is at most `grip` [m/s²], if a slower command is in reach.
    """

    margin: float
    margin_time: float
    brake: float
    alpha_omega: float
    grip: float


@njit(cache=True, error_model="numpy")
def best_twist(
    v: Floats,
    omega: Floats,
    subgoal: Floats,
    points: Floats,
    box: tuple[float, float, float],
    estimate: Estimate,
    safety: Safety,
) -> tuple[float, float, float]:
    """(v, ω) of the safe command with the least expected time to the subgoal, and that time [s]; inf: none is safe.

    v (V,), rising, and omega (W,): all pairs are tried [m/s, rad/s]; subgoal (2,), points (M, 2) in the robot frame [m];
    box: footprint (half_length, half_width, rounding) [m].
    """
    count, r_max = len(v) * len(omega), math.hypot(box[0], box[1])  # a turning disc stays in its place
    twists, margins, stops = np.empty((count, 2)), np.empty(count), np.empty(count)
    for n in range(count):
        speed, rate = v[n // len(omega)], omega[n % len(omega)]
        twists[n, 0], twists[n, 1] = speed, rate
        margins[n] = safety.margin + safety.margin_time * (speed + r_max * abs(rate))
        braking = max(speed / (2.0 * safety.brake), abs(rate) / (2.0 * safety.alpha_omega))
        stops[n] = estimate.period + braking
    free = first_contacts(twists, points, box, margins, stops, stops + estimate.horizon, KEPT) - stops
    best, chosen = np.inf, 0
    for n in range(count):
        speed, rate = twists[n, 0], twists[n, 1]
        if not free[n] >= 0.0 or (speed * abs(rate) > safety.grip and speed > v[0]):
            continue
        time = _time_to(subgoal, speed, rate, free[n], estimate)
        if time < best:
            best, chosen = time, n
    return twists[chosen, 0], twists[chosen, 1], best


@njit(cache=True, error_model="numpy")
def _time_to(subgoal, v, omega, free, estimate):
    """Least expected time to the subgoal over the times for which the command is held, at most `free` but a period [s]."""
    least = np.inf
    for k in range(_HOLDS):
        held = estimate.period + (estimate.horizon - estimate.period) * k / (_HOLDS - 1)
        if k > 0 and held > free:
            break
        half = 0.5 * omega * held
        chord = v * held * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
        x, y = subgoal[0] - chord * math.cos(half), subgoal[1] - chord * math.sin(half)
        bearing = math.atan2(y, x) - 2.0 * half
        bearing -= 2.0 * math.pi * math.floor(bearing / (2.0 * math.pi) + 0.5)
        time = held + math.sqrt(x * x + y * y) / estimate.v_max + estimate.turn * abs(bearing)
        least = min(least, time)
    return least + estimate.slow * (1.0 - v / estimate.v_max)
