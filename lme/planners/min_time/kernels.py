"""Command that brings a robot to a subgoal in the least expected time and lets it still stop in time."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.arcs import clearances, first_contact, within_reach
from lme.geometry.fan import unsigned_bearing
from lme.geometry.straight_ways import KEPT
from lme.types import Floats

FORESEEN = 1.5  # [s] over which motion at constant velocity is predicted
_MEETING = 10.0  # [s] cost of an immediate meeting
_STRIKING = 5.0  # [s/(m/s)] cost of the speed at which one is met although the robot brakes
_STEP = 0.1  # [s] between two places on an arc that are checked
_ROUNDING = 1e-9  # [s] more than any rounding error of a time
_HOLDS = 5  # number of times for which a command is tried, from one period to the horizon


class Estimate(NamedTuple):
    """Parameters of the estimated time to a subgoal. Times [s], v_max [m/s].

    A command is held for some time up to `horizon`, and then its turn is braked. From the heading that this leads to,
    the robot turns to the subgoal, which takes `turn` [s/rad], and drives there at v_max. `slow`: time added for a
    command of speed 0, proportionally less for faster ones.
    """

    v_max: float
    turn: float
    period: float
    horizon: float
    slow: float


class Safety(NamedTuple):
    """Conditions under which a command is safe.

    Along its arc the outline, grown by margin + margin_time · (v + r_max |ω|), touches no point for one period and the
    time to stop, at `brake` [m/s²] and the turn acceleration in use [rad/s²]. v · |ω| is at most `max_lateral_accel`
    [m/s²], if a slower command is in reach. The drive answers with a time constant of `lag` [s], by which the robot
    stops later.
    """

    margin: float
    margin_time: float
    brake: float
    max_lateral_accel: float
    lag: float = 0.0


class Window(NamedTuple):
    """Velocities that can be commanded within a period.

    twist: v and ω now; least, most: those that the drive can reach [m/s, rad/s]; alphas: the limits alpha_v and
    alpha_omega [m/s², rad/s²]. Farther than `near` [m] from every point, and where nothing moves, ω changes by at
    most `calm` [rad/s²], either from its current value or from the one last `asked` for [rad/s], since a drive may
    lag behind.
    """

    twist: tuple[float, float]
    least: tuple[float, float]
    most: tuple[float, float]
    alphas: tuple[float, float]
    calm: float
    near: float
    asked: float


WindowNumbers = tuple[
    tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float], float, float, float
]  # a Window as a plain tuple, which Numba recognises faster
EstimateNumbers = tuple[float, float, float, float, float]  # likewise an Estimate
SafetyNumbers = tuple[float, float, float, float, float]  # and a Safety


@njit(cache=True, error_model="numpy")
def best_command(
    window: WindowNumbers,
    fractions: tuple[Floats, Floats],
    subgoal: Floats,
    points: Floats,
    box: tuple[float, float, float],
    estimate: EstimateNumbers,
    safety: SafetyNumbers,
    movers: Floats,
) -> tuple[float, float, float, float]:
    """Return `best_twist` of all commands of `tried`, and the least speed among these [m/s]."""
    # Sample what can be reached in a period, and choose among all pairs of v and ω.
    v, omega, alpha = tried(window, fractions, Estimate(*estimate).period, points, box, movers)
    best = best_twist(v, omega, alpha, subgoal, points, box, estimate, safety, movers)
    return best[0], best[1], best[2], v[0]


@njit(cache=True, error_model="numpy")
def tried(
    window: WindowNumbers,
    fractions: tuple[Floats, Floats],
    period: float,
    points: Floats,
    box: tuple[float, float, float],
    movers: Floats,
) -> tuple[Floats, Floats, float]:
    """Speeds v ≥ 0 (V,) and turn rates (W,) within a period [m/s, rad/s], and the turn acceleration in use [rad/s²].

    The turn rate nearest to 0 is set to 0 if 0 is among them. fractions: of v (V,) from 0 to 1, of ω (W,) from −1 to 1.
    """
    twist, lowest, highest, alphas, calm, calm_clearance, commanded = window
    alpha = alphas[1]
    # Turn calmly unless something moves or a point is near.
    if calm < alpha and len(movers) == 0 and not (clearances(points, box) < calm_clearance).any():
        alpha = calm
    # Speeds within one period of acceleration, without reversing.
    slowest = max(max(twist[0] - alphas[0] * period, 0.0), lowest[0])
    v = slowest + (max(min(twist[0] + alphas[0] * period, highest[0]), slowest) - slowest) * fractions[0]
    # Turn rates within `alpha` of the interval from the measured to the commanded rate, and within the full
    # acceleration of the measured one.
    from_low, from_high = min(twist[1], commanded), max(twist[1], commanded)
    low = max(from_low - alpha * period, twist[1] - alphas[1] * period, lowest[1])
    high = min(from_high + alpha * period, twist[1] + alphas[1] * period, highest[1])
    omega = (low + high) / 2.0 + (high - low) / 2.0 * fractions[1]
    if low <= 0.0 <= high:
        omega[np.abs(omega).argmin()] = 0.0
    return v, omega, alpha


@njit(cache=True, error_model="numpy")
def best_twist(
    v: Floats,
    omega: Floats,
    alpha_omega: float,
    subgoal: Floats,
    points: Floats,
    box: tuple[float, float, float],
    estimate: EstimateNumbers,
    safety: SafetyNumbers,
    movers: Floats,
) -> tuple[float, float, float]:
    """Return the safe command (v, ω) of least expected time to the subgoal, and that time [s]; inf: none is safe.

    v (V,), rising, and omega (W,): all pairs are tried [m/s, rad/s]. alpha_omega: turn acceleration [rad/s²]. subgoal
    (2,), points (M, 2): in the robot frame [m]. box: footprint (half_length, half_width, rounding) [m]. movers (P, 5):
    x, y, vx, vy and radius of what moves [m, m/s]. A command on whose arc one of them meets the robot's disc within
    `FORESEEN` [s] costs up to `_MEETING` [s] more: the sooner, the more. If the robot would meet them on the arc and
    even while braking, the command costs more, by the speed that is left then: a robot that cannot pass stops in time
    (passive safety, Macek et al. 2009, "Towards safe vehicle navigation in dynamic urban scenarios", Automatika 50).
    """
    # Callers pass plain tuples; the kernel reads their fields by name.
    numbers = Estimate(*estimate), Safety(*safety)
    best: tuple[float, float, float] = _best(v, omega, alpha_omega, subgoal, points, box, *numbers, movers)
    return best


@njit(cache=True, error_model="numpy")
def _best(v, omega, alpha_omega, subgoal, points, box, estimate, safety, movers):
    count, r_max = len(v) * len(omega), math.hypot(box[0], box[1])  # a turning disc stays in its place
    twists, margins, stops = np.empty((count, 2)), np.empty(count), np.empty(count)
    # Margin of every pair, and the time on its arc that it takes to stop. Braking from v covers v² / (2 b) [m],
    # as v / (2 b) seconds at constant speed do; the turn likewise.
    for n in range(count):
        speed, rate = v[n // len(omega)], omega[n % len(omega)]
        twists[n, 0], twists[n, 1] = speed, rate
        margins[n] = safety.margin + safety.margin_time * (speed + r_max * abs(rate))
        braking = max(speed / (2.0 * safety.brake), abs(rate) / (2.0 * alpha_omega))
        stops[n] = estimate.period + braking + safety.lag
    # Keep the points that some arc may meet, and bound every expected time from below, as if no point were there.
    reachable = within_reach(twists, points, box, margins, stops + estimate.horizon, KEPT)
    durations, moves = _hold_moves(omega, estimate, alpha_omega)
    bounds = _least_times(v, omega, subgoal, durations, moves, estimate, safety.max_lateral_accel)
    best, best_index = np.inf, 0
    reach = r_max + box[2] + safety.margin
    while True:  # the most promising one first, so that few arcs are checked
        n = int(np.argmin(bounds))
        # No pair that is left can be better than the best so far.
        if not bounds[n] <= best or bounds[n] == np.inf:
            return twists[best_index, 0], twists[best_index, 1], best
        bounds[n] = np.inf
        speed, rate = twists[n, 0], twists[n, 1]
        horizon = stops[n] + estimate.horizon
        # How long the command can be held if the robot is still to stop before contact.
        free = first_contact(speed, rate, reachable, box, margins[n], stops[n], horizon) - stops[n]
        if not free >= 0.0:
            continue
        time = _time_to(subgoal, speed, rate, free, durations, moves[n % len(omega)], estimate)
        if len(movers):
            time += _movers_cost(speed, rate, movers, reach, estimate.period + safety.lag, safety.brake)
        if time < best or (time == best and n < best_index):
            best, best_index = time, n


@njit(cache=True, error_model="numpy")
def _hold_moves(omega, estimate, alpha_omega):
    """Return the times for which a command is held (K,) [s], and the effect of each turn rate (W, K, 4).

    The effect is cosine and sine of half of the turn, the chord of an arc of length 1, and the heading that the robot
    reaches when the turn is braked at alpha_omega [rad/s²].
    """
    durations, moves = np.empty(_HOLDS), np.empty((len(omega), _HOLDS, 4))
    for k in range(_HOLDS):
        # Evenly spaced from one period to the horizon.
        durations[k] = estimate.period + (estimate.horizon - estimate.period) * k / (_HOLDS - 1)
        for w in range(len(omega)):
            # Half of the turn, the ratio of chord to arc, sin(half) / half, and the heading at rest,
            # ω t + ω |ω| / (2 α).
            half = 0.5 * omega[w] * durations[k]
            moves[w, k, 0], moves[w, k, 1] = math.cos(half), math.sin(half)
            moves[w, k, 2] = moves[w, k, 1] / half if abs(half) > 1e-6 else 1.0
            moves[w, k, 3] = omega[w] * (durations[k] + abs(omega[w]) / (2.0 * alpha_omega))
    return durations, moves


@njit(cache=True, error_model="numpy")
def _least_times(v, omega, subgoal, durations, moves, estimate, grip):
    """Time of each command without obstacles, less `_ROUNDING` [s]; inf: no grip. Faster than `_time_to`."""
    count = len(v) * len(omega)
    x, y, heading = np.empty((3, _HOLDS, count))
    # From where the robot is after each hold: the vector to the subgoal, and the heading.
    for k in range(_HOLDS):
        for n in range(count):
            w = n % len(omega)
            chord = v[n // len(omega)] * durations[k] * moves[w, k, 2]
            x[k, n], y[k, n] = subgoal[0] - chord * moves[w, k, 0], subgoal[1] - chord * moves[w, k, 1]
            heading[k, n] = moves[w, k, 3]
    # Time of the hold, then straight on at v_max, and the turn that is left; the least over all holds.
    times = np.full(count, np.inf)
    for k in range(_HOLDS):
        for n in range(count):  # without branches, so that it is vectorised
            turn = math.copysign(unsigned_bearing(x[k, n], y[k, n]), y[k, n]) - heading[k, n]
            turn = abs(turn - 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5))
            straight = durations[k] + math.sqrt(x[k, n] * x[k, n] + y[k, n] * y[k, n]) / estimate.v_max
            times[n] = min(times[n], straight + estimate.turn * turn)
    for n in range(count):
        # Slow commands cost more. Commands beyond the grip are excluded, except at the lowest speed.
        speed = v[n // len(omega)]
        times[n] += estimate.slow * (1.0 - speed / estimate.v_max) - _ROUNDING
        if speed * abs(omega[n % len(omega)]) > grip and speed > v[0]:
            times[n] = np.inf
    return times


@njit(cache=True, error_model="numpy", inline="always")
def _on_arc(v, omega, time):
    """Position of the robot after some time on its arc [m]."""
    half = 0.5 * omega * time
    chord = v * time * (math.sin(half) / half if abs(half) > 1e-6 else 1.0)
    return chord * math.cos(half), chord * math.sin(half)


@njit(cache=True, error_model="numpy")
def _movers_cost(v, omega, movers, reach, delay, brake):
    """Time that movers add to a command [s]. delay: until the robot can brake [s]."""
    stopping_time = delay + v / brake
    meeting_time = _meeting_time(v, omega, movers, reach, np.inf, brake, max(FORESEEN, stopping_time))
    cost = _MEETING * (1.0 - min(meeting_time, FORESEEN) / FORESEEN)
    if meeting_time < np.inf and v > 0.0:
        striking_time = _meeting_time(v, omega, movers, reach, delay, brake, stopping_time)
        cost += _STRIKING * max(v - brake * max(striking_time - delay, 0.0), 0.0)
    return cost


@njit(cache=True, error_model="numpy")
def _meeting_time(v, omega, movers, reach, delay, brake, horizon):
    """Time [s] until the robot on its arc is within `reach` of a mover and approaching; inf: not up to `horizon`.

    The command is held for `delay` [s]; then the robot brakes on its arc at `brake` [m/s²].
    """
    steps, meeting_time = int(horizon / _STEP + 0.5), np.inf
    for n in range(len(movers)):
        contact_distance = reach + movers[n, 4]
        # Distances are compared as squares.
        start_square = movers[n, 0] ** 2 + movers[n, 1] ** 2
        for k in range(1, steps + 1):
            time = k * _STEP
            # While it brakes, the robot falls behind its constant speed by b (t − t_held)² / 2 [m].
            braking = time - delay
            x, y = _on_arc(v, omega, time if braking <= 0.0 else time - braking * braking * brake / (2.0 * v))
            dx = movers[n, 0] + time * movers[n, 2] - x
            dy = movers[n, 1] + time * movers[n, 3] - y
            square = dx * dx + dy * dy
            if square < contact_distance * contact_distance and square < start_square:
                # For the movers that follow, only an earlier meeting matters.
                steps = k - 1
                meeting_time = steps * _STEP
                break
            start_square = square
    return meeting_time


@njit(cache=True, error_model="numpy")
def _time_to(subgoal, v, omega, free, durations, moves, estimate):
    """Least expected time to the subgoal [s], if the command is held for one period or longer, up to `free` [s]."""
    min_time = np.inf
    for k in range(_HOLDS):
        duration = durations[k]
        if k > 0 and duration > free:
            break
        # From where the robot is after the hold, drive straight to the subgoal at v_max.
        chord = v * duration * moves[k, 2]
        x, y = subgoal[0] - chord * moves[k, 0], subgoal[1] - chord * moves[k, 1]
        straight = duration + math.sqrt(x * x + y * y) / estimate.v_max
        if straight >= min_time:
            continue  # with the turn it is no less
        # Add the time for the turn that is left, wrapped to the shorter way.
        bearing = math.atan2(y, x) - moves[k, 3]
        bearing -= 2.0 * math.pi * math.floor(bearing / (2.0 * math.pi) + 0.5)
        min_time = min(min_time, straight + estimate.turn * abs(bearing))
    return min_time + estimate.slow * (1.0 - v / estimate.v_max)
