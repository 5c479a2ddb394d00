"""Recoveries of the timed elastic band: a shorter horizon after failures, and one direction of turns when it wavers."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from lme.planners.teb.config import TebConfig
from lme.types import Twist

_MAX_FAILURES = 10  # failures in a row


class Horizon:
    """Share of the horizon in use: half of it for some time after a failure, a quarter after ten in a row.

    teb_local_planner says the same, but its code then uses three quarters.
    """

    def __init__(self, config: TebConfig, dt: float) -> None:
        """dt: control period [s]."""
        self._periods = round(config.shrink_horizon_min_duration / dt)
        self.reset()

    def reset(self) -> None:
        """Forget all failures."""
        self._in_a_row, self._remaining = 0, 0

    @property
    def share(self) -> float:
        """Share of the horizon to use."""
        if self._remaining == 0:
            return 1.0
        return 0.25 if self._in_a_row >= _MAX_FAILURES else 0.5

    def record(self, *, failed: bool) -> None:
        """Record whether this period failed to give a feasible band."""
        if failed:
            self._in_a_row, self._remaining = self._in_a_row + 1, self._periods
        else:
            self._in_a_row, self._remaining = 0, max(self._remaining - 1, 0)


class Oscillation:
    """Detects commands that waver on the spot, and then keeps the current direction of turns for some time."""

    def __init__(self, config: TebConfig, dt: float, v_max: float, omega_max: float) -> None:
        """dt: control period [s]; v_max [m/s] and omega_max [rad/s]: the limits that commands are measured by."""
        self._config = config
        self._scale = (v_max, omega_max)
        self._size = max(round(config.oscillation_filter_duration / dt), 2)
        self._periods = round(config.oscillation_recovery_min_duration / dt)
        self.reset()

    def reset(self) -> None:
        """Forget all commands."""
        self._commands: deque[tuple[float, float]] = deque(maxlen=self._size)
        self._remaining, self.turn = 0, 0.0  # periods to keep to the direction; 1 left, -1 right, 0 any

    def record(self, command: Twist, omega: float) -> None:
        """Record a command, and the turn rate [rad/s] at which the robot is turning."""
        self._commands.append((command.v / self._scale[0], command.omega / self._scale[1]))
        self._remaining = max(self._remaining - 1, 0)
        if self._wavers():
            if self._remaining == 0:
                self.turn = 1.0 if omega > 0.0 else -1.0
            self._remaining = self._periods
        elif self._remaining == 0:
            self.turn = 0.0

    def _wavers(self) -> bool:
        """Return whether mean velocity and turn rate are near zero, but the turns change sides."""
        commands, config = self._commands, self._config
        if len(commands) < self._size // 2:
            return False
        v = sum(command[0] for command in commands) / len(commands)
        omega = sum(command[1] for command in commands) / len(commands)
        sides = [math.copysign(1.0, command[1]) if command[1] else 0.0 for command in commands]
        changes = sum(side != next_side for side, next_side in pairwise(sides))
        return abs(v) < config.oscillation_v_eps and abs(omega) < config.oscillation_omega_eps and changes > 1
