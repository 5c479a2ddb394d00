"""How a velocity command may follow the last one: within the limits of velocity and acceleration."""

from __future__ import annotations

from lme.types import Limits, Twist


def reachable(v: float, omega: float, now: Twist, limits: Limits, dt: float) -> Twist:
    """The twist nearest to (v, ω) within the limits of velocity, and of acceleration `dt` [s] after `now`."""
    v = min(max(v, limits.lowest), limits.v_max)
    omega = min(max(omega, -limits.omega_max), limits.omega_max)
    return Twist(
        towards(v, now.v, limits.alpha_v, dt),
        towards(omega, now.omega, limits.alpha_omega, dt),
    )


def towards(wanted: float, rate: float, alpha: float, dt: float) -> float:
    """The rate nearest to `wanted` that is reachable from `rate` in one period at `alpha`."""
    return min(max(wanted, rate - alpha * dt), rate + alpha * dt)
