"""Drive whose velocity approaches the command with a time constant."""

import math

from lme.types import Limits, Twist


class Lag:
    """First-order lag of v and ω: after a time t, e^(−t/τ) of their difference from the command is left.

    Limits of acceleration are not modelled. With τ = 0 the velocity is that of the command.
    """

    def __init__(self, time_constant: float, dt: float) -> None:
        """time_constant: τ [s]; dt: the control period [s]."""
        self._time_constant, self._dt = time_constant, dt

    def after(self, twist: Twist, command: Twist, duration: float) -> Twist:
        """Return the twist `duration` [s] later."""
        if self._time_constant == 0.0:
            return command
        decay = math.exp(-duration / self._time_constant)
        return Twist(
            command.v + decay * (twist.v - command.v), command.omega + decay * (twist.omega - command.omega)
        )

    def reach(self, twist: Twist, limits: Limits) -> tuple[Twist, Twist]:
        """Return the least and the greatest v and ω to which commands within the limits lead in one period."""
        lowest, highest = Twist(limits.lowest, -limits.omega_max), Twist(limits.v_max, limits.omega_max)
        return self.after(twist, lowest, self._dt), self.after(twist, highest, self._dt)

    def command_for(self, desired: Twist, twist: Twist, limits: Limits) -> Twist:
        """Return the command that leads to the desired twist in one period, or the nearest one within the limits."""
        if self._time_constant == 0.0:
            return desired
        gain = -1.0 / math.expm1(-self._dt / self._time_constant)
        v, omega = (current + gain * (goal - current) for current, goal in zip(twist, desired, strict=True))
        return Twist(
            min(max(v, limits.lowest), limits.v_max), min(max(omega, -limits.omega_max), limits.omega_max)
        )
