"""The invariant of docs/safety.md: a robot that can stop without touching what was seen gets to another such state."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lme.planners.safety.kernels import StoppingMotion, stopping_clearances, twist_after
from lme.robots import Footprint
from lme.types import Floats, Limits, Twist

STILL = Twist(0.0, 0.0)
TOUCHING = 1e-6  # [m] nearer counts as contact: far beyond rounding errors, and less than any scan resolves
_V_SAMPLES, _OMEGA_SAMPLES = 9, 15  # of the commands among which the nearest one is looked for
_ROUNDING = 1e-9  # [s]
_NONE = np.empty((0, 2))


class StoppingState(NamedTuple):
    """Obstacle points (M, 2) in the robot frame [m], the twist, and the limits. A state has commands under way, too."""

    points: Floats
    twist: Twist
    limits: Limits


class StoppingCheck:
    """Says of commands whether the robot could still stop after them, and finds the nearest one of which that is true.

    It counts the commands under way itself. The robot can stop if these, and then zero until it stands, lead to no
    contact of the outline with a point (`lme.planners.safety.kernels`).
    """

    def __init__(self, outline: Footprint, dt: float, latency: float = 0.0, lag: float = 0.0) -> None:
        """dt: control period; latency: known delay of commands; lag: known time constant of the drive [s]."""
        half_length, half_width, rounding = outline.box
        self._box = float(half_length), float(half_width), float(rounding)
        self._r_max = outline.r_max
        periods = math.ceil(latency / dt - _ROUNDING)
        late = periods * dt - latency
        self._times = dt, late if late > _ROUNDING else 0.0, lag
        self.under_way: deque[Twist] = deque(maxlen=periods)
        self._tested = np.empty((1, 2))  # the command that `clearance` is asked for
        self.reset()

    def reset(self) -> None:
        """Forget the commands: before the first one, the robot stands."""
        self.under_way.extend([STILL] * (self.under_way.maxlen or 0))

    def sent(self, command: Twist) -> None:
        """Count a command as under way. Call it once per control period."""
        self.under_way.append(command)

    def clearance(self, command: Twist, now: StoppingState, enough: float = TOUCHING) -> float:
        """Least distance to a point with this command, until the robot stands [m]; at most `enough`."""
        self._tested[0, 0], self._tested[0, 1] = command
        return float(self._clearances(self._tested, now, enough)[0])

    def stops(self, command: Twist, now: StoppingState) -> bool:
        """Whether the robot can stop after the command without contact. After zero: whether it can stop now."""
        return self.clearance(command, now) >= TOUCHING

    def nearest(self, wanted: Twist, now: StoppingState, enough: float = TOUCHING) -> Twist | None:
        """The command after which the robot can stop with this clearance [m], nearest to the wanted one; None: none.

        What counts is how much the velocity of a point of the outline differs. A regular sample of the commands that
        are within reach in a period is tried.
        """
        tried = self._tried(wanted, now)
        far = np.abs(tried - wanted) @ [1.0, self._r_max]
        tried = tried[np.argsort(far, kind="stable")]
        found = np.flatnonzero(self._clearances(tried, now, enough) >= enough)
        return Twist(*tried[found[0]].tolist()) if len(found) else None

    def _tried(self, wanted: Twist, now: StoppingState) -> Floats:
        """Commands (N, 2) within reach of the twist that the robot will have; the wanted v and ω are among theirs."""
        limits, dt = now.limits, self._times[0]
        v, omega = twist_after(_plain(now.twist), self._sent(), self._motion(limits))
        low = (
            max(v - limits.alpha_v * dt, limits.lowest),
            max(omega - limits.alpha_omega * dt, -limits.omega_max),
        )
        high = (
            min(v + limits.alpha_v * dt, limits.v_max),
            min(omega + limits.alpha_omega * dt, limits.omega_max),
        )
        speeds = [*np.linspace(low[0], high[0], _V_SAMPLES), min(max(wanted.v, low[0]), high[0])]
        rates = [*np.linspace(low[1], high[1], _OMEGA_SAMPLES), min(max(wanted.omega, low[1]), high[1])]
        return np.array(np.meshgrid(speeds, rates)).reshape(2, -1).T

    def _clearances(self, tried: Floats, now: StoppingState, enough: float) -> Floats:
        start = now.points, _plain(now.twist), self._sent()
        found: Floats = stopping_clearances(*start, tried, self._motion(now.limits), self._box, enough)
        return found

    def _sent(self) -> Floats:
        if not self.under_way:
            return _NONE
        return np.array(self.under_way, dtype=np.float64)

    def _motion(self, limits: Limits) -> tuple[tuple[float, float, float, float], float, float, float]:
        """A plain tuple: Numba takes a named one for another type."""
        return (*StoppingMotion(limits.bounds, *self._times),)


def _plain(twist: Twist) -> tuple[float, float]:
    return float(twist[0]), float(twist[1])
