"""Ramps of velocity commands: each follows the last one within the limits of velocity and acceleration."""

from __future__ import annotations

from lme.types import Limits, Twist


def reachable(v: float, omega: float, twist: Twist, limits: Limits, dt: float) -> Twist:
    """Return the twist nearest to (v, ω) within the limits of velocity that can be reached from `twist` in `dt` [s]."""
    v = min(max(v, limits.lowest), limits.v_max)
    omega = min(max(omega, -limits.omega_max), limits.omega_max)
    return Twist(
        towards(v, twist.v, limits.alpha_v, dt),
        towards(omega, twist.omega, limits.alpha_omega, dt),
    )


def towards(goal: float, rate: float, alpha: float, dt: float) -> float:
    """Return the rate nearest to `goal` that is reachable from `rate` in a period `dt` at acceleration `alpha`."""
    return min(max(goal, rate - alpha * dt), rate + alpha * dt)
