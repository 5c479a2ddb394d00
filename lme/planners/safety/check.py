"""Invariant of docs/understand/safety.md: from a state in which it can stop, the robot reaches another such state."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from lme.planners.safety.kernels import StoppingMotion, stopping_clearances
from lme.robots import Footprint, reachable
from lme.types import Floats, Limits, Observation, Twist

STILL = Twist(0.0, 0.0)
TOUCHING = 1e-6  # [m] nearer counts as contact: far beyond rounding errors, and less than any scan resolves
_V_SAMPLES, _OMEGA_SAMPLES = 9, 15  # of the commands among which the nearest one is looked for
_ROUNDING = 1e-9  # [s]
_NO_COMMANDS = np.empty((0, 2))


class StoppingState(NamedTuple):
    """State to stop from: obstacle points (M, 2) in the robot frame [m], twists, and limits.

    twists: possible motions of the robot, such as the measured twist and the last command (`Observation.twists`); a
    property of the state must hold for all of them. ramp_start: the twist from which commands ramp. The commands
    under way, which belong to the state too, are kept by `StoppingCheck`.
    """

    points: Floats
    twists: tuple[Twist, ...]
    limits: Limits
    ramp_start: Twist

    @classmethod
    def of(cls, observation: Observation, points: Floats) -> StoppingState:
        """Return the state of an observation among these points."""
        return cls(points, observation.twists, observation.limits, observation.ramp_start)

    def as_measured(self) -> StoppingState:
        """Return the state with the measured twist alone."""
        return self._replace(twists=self.twists[:1])


class StoppingCheck:
    """Checks whether the robot can still stop after a command, and finds the nearest command for which it can.

    It keeps track of the commands under way itself. The robot can stop if these, and then commands that ramp to zero
    until it stands, lead to no contact of the outline with a point (`lme.planners.safety.kernels`).
    """

    def __init__(self, outline: Footprint, dt: float, latency: float = 0.0, lag: float = 0.0) -> None:
        """dt: control period; latency: known delay of commands; lag: known time constant of the drive [s]."""
        half_length, half_width, rounding = outline.box
        self._box = float(half_length), float(half_width), float(rounding)
        self._r_max = outline.circumscribed_radius
        periods = math.ceil(latency / dt - _ROUNDING)
        delay = periods * dt - latency
        self._times = dt, delay if delay > _ROUNDING else 0.0, lag
        self.under_way: deque[Twist] = deque(maxlen=periods)
        self._tested = np.empty((1, 2))  # command whose clearance is computed, reused as a buffer
        self.reset()

    def reset(self) -> None:
        """Forget the commands: before the first one, the robot is at rest."""
        self.under_way.extend([STILL] * (self.under_way.maxlen or 0))

    def sent(self, command: Twist) -> None:
        """Count a command as under way. Call it once per control period."""
        self.under_way.append(command)

    def clearance(self, command: Twist, state: StoppingState, sufficient: float = TOUCHING) -> float:
        """Return the least distance to a point from the command until rest [m]; at most `sufficient`.

        The command is limited to the nearest one within a ramp, so zero brakes.
        """
        self._tested[0] = reachable(*command, state.ramp_start, state.limits, self._times[0])
        return min(
            float(self._clearances(self._tested, state, twist, sufficient)[0]) for twist in state.twists
        )

    def stops(self, command: Twist, state: StoppingState) -> bool:
        """Return whether the robot can stop after the command without contact. With zero: whether it can stop now."""
        return self.clearance(command, state) >= TOUCHING

    def nearest(self, desired: Twist, state: StoppingState, sufficient: float = TOUCHING) -> Twist | None:
        """Return the nearest command after which the robot can stop with this clearance [m]; None: there is none.

        Nearness to the wanted command is measured by the velocity of a point of the outline. A regular sample of the
        commands within reach in a period is tried.
        """
        # Candidates in the order of their difference |Δv| + r_max |Δω| from the wanted command.
        candidates = self._candidates(desired, state)
        differences = np.abs(candidates - desired) @ [1.0, self._r_max]
        candidates = candidates[np.argsort(differences, kind="stable")]
        while len(candidates):
            # The first that is safe with the measured twist is checked with the other twists too.
            first = np.flatnonzero(
                self._clearances(candidates, state, state.twists[0], sufficient) >= sufficient
            )
            if not len(first):
                return None
            command = Twist(*candidates[first[0]].tolist())
            if len(state.twists) == 1 or self.clearance(command, state, sufficient) >= sufficient:
                return command
            candidates = candidates[first[0] + 1 :]
        return None

    def _candidates(self, desired: Twist, state: StoppingState) -> Floats:
        """Return commands (N, 2) within reach of the last one; their v and ω include the wanted ones."""
        limits, dt = state.limits, self._times[0]
        v, omega = state.ramp_start
        low = (
            max(v - limits.alpha_v * dt, limits.lowest),
            max(omega - limits.alpha_omega * dt, -limits.omega_max),
        )
        high = (
            min(v + limits.alpha_v * dt, limits.v_max),
            min(omega + limits.alpha_omega * dt, limits.omega_max),
        )
        speeds = [*np.linspace(low[0], high[0], _V_SAMPLES), min(max(desired.v, low[0]), high[0])]
        rates = [*np.linspace(low[1], high[1], _OMEGA_SAMPLES), min(max(desired.omega, low[1]), high[1])]
        return np.array(np.meshgrid(speeds, rates)).reshape(2, -1).T

    def _clearances(
        self, candidates: Floats, state: StoppingState, twist: Twist, sufficient: float
    ) -> Floats:
        sent = np.array(self.under_way, dtype=np.float64) if self.under_way else _NO_COMMANDS
        # Plain tuples, since a named one is a different type to Numba.
        start = float(twist[0]), float(twist[1])
        motion = (*StoppingMotion(state.limits.bounds, *self._times),)
        clearances: Floats = stopping_clearances(
            state.points, start, sent, candidates, motion, self._box, sufficient
        )
        return clearances
