"""Velocity commands within a robot's limits of velocity and acceleration."""

from __future__ import annotations

import math

import numpy as np

from lme.errors import argument_error, require
from lme.robots import reachable, towards
from lme.types import Floats, Observation, Twist

MOST_SAMPLES = 1001  # of v and of ω: a planner holds values of every pair
_AT_REST = 1e-6  # [m/s, rad/s] slower than this counts as 0


def without_tiny_rates(twist: Twist) -> Twist:
    """Return the twist with rates that are too small to matter set to 0, since their quotients would overflow."""
    v, omega = twist
    return Twist(v if abs(v) > _AT_REST else 0.0, omega if abs(omega) > _AT_REST else 0.0)


def limited(v: float, omega: float, observation: Observation, dt: float) -> Twist:
    """Return the command nearest to (v, ω) that the limits allow within one period `dt` [s] of `ramp_start`."""
    return reachable(v, omega, observation.ramp_start, observation.limits, dt)


def approach(error: float, rate: float, rate_max: float, alpha: float, dt: float) -> float:
    """Return the rate that drives `error` to zero as fast as possible without overshoot.

    Accelerates at `alpha` up to `rate_max`, then brakes at `alpha`. It is the largest rate such that braking at
    `alpha` after one more period, which starts at `rate`, covers no more than `error`.
    """
    sign = math.copysign(1.0, error)
    ahead, speed = abs(error), max(sign * rate, 0.0)
    braking = speed * speed / (2.0 * alpha)
    if speed * dt + braking <= ahead:  # may speed up: u·dt − (u − speed)²/2α + u²/2α = ahead
        reachable = (ahead + braking) / (dt + speed / alpha)
    else:  # must slow down: (speed² − u²)/2α + u·(dt − (speed − u)/α) + u²/2α = ahead
        slack = speed - alpha * dt
        reachable = (slack + math.sqrt(max(slack * slack + 4.0 * alpha * (ahead - braking), 0.0))) / 2.0
        reachable = max(reachable, 0.0) if ahead > braking else 0.0
    return towards(sign * min(rate_max, reachable), rate, alpha, dt)


def check_turn_samples(number: int) -> None:
    """Raise InputError unless this number of turn rates, `omega_samples`, can have 0 in its middle."""
    require("omega_samples", number, at_least=3, at_most=MOST_SAMPLES)
    if number % 2 == 0:
        raise argument_error(f"omega_samples is {number}: must be odd, so that the robot may drive straight")


def turn_shares(number: int) -> Floats:
    """Return an odd number of shares of a range of turn rates, −1 to 1, exactly symmetric: (number,)."""
    half = np.linspace(0.0, 1.0, number // 2 + 1)
    return np.concatenate((-half[:0:-1], half))
