"""Dynamic Window Approach: the best of the reachable velocities from which the robot can stop in time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.geometry.arcs import clearances, first_contacts
from lme.perception.scan_points import obstacle_points
from lme.planners.commands import MOST_SAMPLES, Weighed, approach, check_turn_samples, limited, turn_shares
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation, Twist


@dataclass(slots=True)
class DwaConfig:
    """Gains of the objective, safety margin and sampling of the window."""

    heading: float
    clearance: float
    velocity: float
    heading_time: float | None
    clear_way: float
    margin: float
    margin_time: float
    v_samples: int
    omega_samples: int

    def __post_init__(self) -> None:
        for key in ("heading", "clearance", "velocity", "margin", "margin_time"):
            require(key, getattr(self, key), at_least=0.0)
        require("clear_way", self.clear_way, above=0.0)
        if self.heading_time is not None:
            require("heading_time", self.heading_time, above=0.0)
        require("v_samples", self.v_samples, at_least=2, at_most=MOST_SAMPLES)
        check_turn_samples(self.omega_samples)


class _Window(NamedTuple):
    """Velocities reachable within a period, v (V, 1) rising and omega (1, W), and times for each pair.

    stopping (V, W): least time until contact that allows a stop after one more period [s]. contact (V, W):
    time until contact [s]; exact if it is at least `stopping`.
    """

    v: Floats
    omega: Floats
    contact: Floats
    stopping: Floats


class Dwa:
    """Dynamic Window Approach (Fox, Burgard, Thrun 1997, IEEE RAM 4(1):23–33, doi:10.1109/100.580977).

    As in the paper: circular arcs; only velocities from which the robot can stop before contact; heading,
    clearance and velocity, each in [0, 1]; a safety margin that grows with velocity; turning away if no arc is
    free. The stopping time includes the period until the next command, and the robot's settling time. The objective
    is not smoothed.
    """

    Config = DwaConfig

    def __init__(self, config: DwaConfig, robot: Robot) -> None:
        self._config = config
        self._box = robot.footprint.box
        self._mount = robot.lidar.mount
        self._dt, self._settling = robot.dt, robot.settling_time
        self._v_fractions = np.linspace(0.0, 1.0, config.v_samples)
        self._omega_fractions = turn_shares(config.omega_samples)

    def reset(self, rng: np.random.Generator) -> None:
        """Do nothing: there is no state."""

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        points = obstacle_points(observation.scan, self._mount)
        window = self._window(observation, guidance.subgoal, points)
        admissible = window.contact >= window.stopping
        driving = window.v[:, 0] > 0.0
        if driving.any() and not admissible[driving].any():
            command = self._turn_away(window, points, observation.ramp_start)
        else:
            score = self._objective(window, guidance.subgoal, observation.limits)
            score[~admissible] = -np.inf
            row, column = divmod(int(score.argmax()), window.omega.size)
            command = window.v[row, 0], window.omega[0, column]
        return limited(float(command[0]), float(command[1]), observation, self._dt)

    def weighed(self, observation: Observation, guidance: Guidance) -> Weighed:
        """Return the window with the costs −G(v, ω); see `Weighed`."""
        window = self._window(observation, guidance.subgoal, obstacle_points(observation.scan, self._mount))
        score = self._objective(window, guidance.subgoal, observation.limits)
        costs = np.where(window.contact >= window.stopping, -score, np.inf)
        commands = np.stack(np.broadcast_arrays(window.v, window.omega), axis=-1).reshape(-1, 2)
        return Weighed(commands, costs.ravel(), self._config.heading_time or self._dt)

    def _window(self, observation: Observation, subgoal: Floats, points: Floats) -> _Window:
        """Velocities that are reachable in one period and allow a stop at the subgoal."""
        limits, twist, dt, config = observation.limits, observation.ramp_start, self._dt, self._config
        distance = math.hypot(*subgoal)
        v_low = max(twist.v - limits.alpha_v * dt, 0.0)
        v_high = approach(distance, twist.v, limits.v_max, limits.alpha_v, dt)
        v_high = min(v_high, limits.omega_max * distance / 2.0)  # a faster robot could circle the subgoal
        v = v_low + (max(v_high, v_low) - v_low) * self._v_fractions[:, None]
        omega = self._turn_rates(twist, limits)[None, :]
        braking = np.maximum(v / (2.0 * limits.alpha_v), np.abs(omega) / (2.0 * limits.alpha_omega))
        stopping = dt + self._settling + braking
        twists = np.stack(np.broadcast_arrays(v, omega), axis=-1).reshape(-1, 2)
        margins = config.margin + config.margin_time * twists[:, 0]
        horizons = np.maximum(stopping, config.clear_way / np.maximum(v, 1e-3)).ravel()
        contact = first_contacts(twists, points, self._box, margins, stopping.ravel(), horizons)
        return _Window(v, omega, contact.reshape(stopping.shape), stopping)

    def _turn_rates(self, twist: Twist, limits: Limits) -> Floats:
        """Turn rates that are reachable in one period; the one nearest to 0 is set to 0."""
        low = max(twist.omega - limits.alpha_omega * self._dt, -limits.omega_max)
        high = min(twist.omega + limits.alpha_omega * self._dt, limits.omega_max)
        omega: Floats = (low + high) / 2.0 + (high - low) / 2.0 * self._omega_fractions
        omega[np.abs(omega) < (high - low) / (2.0 * (omega.size - 1))] = 0.0
        return omega

    def _objective(self, window: _Window, subgoal: Floats, limits: Limits) -> Floats:
        """G(v, ω) of the paper: (V, W). Clearance is the distance driven until contact, 0 for a standing robot."""
        config = self._config
        distance = np.zeros_like(window.contact)
        np.multiply(window.v, window.contact, out=distance, where=window.v > 0.0)
        clear = np.minimum(distance, config.clear_way) / config.clear_way
        heading = self._heading(window, subgoal, limits)
        velocity = window.v / limits.v_max
        return config.heading * heading + config.clearance * clear + config.velocity * velocity

    def _heading(self, window: _Window, subgoal: Floats, limits: Limits) -> Floats:
        """Heading term (V, W): 1 if the robot would face the subgoal after braking, 0 if it would face away.

        The predicted distance is at most half of that to the subgoal, where the bearing is undefined.
        """
        v, omega = window.v, window.omega
        time = self._dt if self._config.heading_time is None else self._config.heading_time
        distance = np.minimum(v * time + v * v / (2.0 * limits.alpha_v), math.hypot(*subgoal) / 2.0)
        angle = omega * time + omega * np.abs(omega) / (2.0 * limits.alpha_omega)
        chord = distance * np.sinc(angle / (2.0 * np.pi))  # of the arc; its bearing is half the turn
        x, y = subgoal[0] - chord * np.cos(angle / 2.0), subgoal[1] - chord * np.sin(angle / 2.0)
        error = np.abs(np.arctan2(y, x) - angle)
        facing: Floats = 1.0 - np.abs((error + np.pi) % (2.0 * np.pi) - np.pi) / np.pi
        return facing

    def _turn_away(self, window: _Window, points: Floats, twist: Twist) -> tuple[float, float]:
        """Brake where no arc is free, then turn in place, as before or away from the nearest point."""
        v_low, omega = window.v[0, 0], window.omega[0]
        if v_low > 0.0:
            return 0.0, twist.omega * v_low / twist.v  # stay on the current arc, on which a stop was possible
        free = omega[(window.contact[0] >= window.stopping[0]) & (omega != 0.0)]
        if not free.size:
            return 0.0, 0.0
        nearest = points[clearances(points, self._box).argmin()]
        side = math.copysign(1.0, twist.omega if twist.omega != 0.0 else -nearest[1])
        preferred = free[free * side > 0.0]
        options = preferred if preferred.size else free
        return 0.0, options[np.abs(options).argmax()]
