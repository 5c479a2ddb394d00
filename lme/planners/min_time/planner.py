"""Minimum-time arcs: LME+'s own planner."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import config_key, require
from lme.geometry.arcs import first_contacts
from lme.geometry.frames import to_robot
from lme.geometry.motion import WIDEST, drive, movers_among
from lme.geometry.straight_ways import KEPT
from lme.inputs import plausibility
from lme.perception.scan_points import is_full_circle, obstacle_points
from lme.planners.commands import Weighed, limited, turn_shares, without_tiny_rates
from lme.planners.min_time.kernels import best_command, best_twist, tried
from lme.planners.min_time.multi_point_turn import MultiPointTurn
from lme.planners.safety.check import STILL, StoppingCheck, StoppingState
from lme.robots import Robot, reachable
from lme.types import Floats, Guidance, Limits, Observation, Pose, Twist

_STEP = 0.05  # [m] of the prediction over the latency
_NOBODY = np.empty((0, 5))
_HORIZON = 0.5  # [s] a command is held for up to this time
_TURN = 0.5  # [s/rad] expected time to turn to the subgoal after that
_SPEEDS, _RATES = 7, 15  # numbers of v and of ω that are tried; odd, so that one ω is in the middle
_CALM = 10.0  # [rad/s²] greatest turn acceleration, but near obstacles and where people move
_NEAR = 0.15  # [m] distance of the footprint to obstacle points at which it uses all that the robot has
_BACK = 0.3  # [m] distance that a stuck robot backs up at least
_BACKWARD = 0.25  # share of v_max at which the robot backs up
_ARCS = 7  # on which it may back up
_BACK_INTERVAL = 10.0  # [s] since the robot last began to back up: until then it does so again only after
_PATIENCE = 1.0  # [s] of slow driving, in which it may turn out of a narrow place
_SLOW = 0.05  # [s] extra cost of a command of speed 0 over one of v_max


@dataclass(slots=True)
class MinTimeParts:
    """Parts of the planner; False leaves one out, for an ablation."""

    calm: bool
    backing_up: bool
    multi_point: bool


@dataclass(slots=True)
class MinTimeConfig:
    """Distances that the planner keeps, and properties of the robot on which it may rely."""

    margin: float
    margin_time: float
    brake: float
    max_lateral_accel: float
    latency: float
    lag: float
    parts: MinTimeParts

    def __post_init__(self) -> None:
        for key in ("margin", "margin_time", "latency", "lag"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("brake", "max_lateral_accel"):
            require(key, getattr(self, key), above=0.0)
        for key in ("latency", "lag"):
            plausibility.check(config_key(key), getattr(self, key))


class _Situation(NamedTuple):
    """Input of a decision: subgoal (2,), points (M, 2), movers (P, 5) and path (K, 2) in the robot frame."""

    subgoal: Floats
    points: Floats
    movers: Floats
    twist: Twist
    path: Floats | None


def _shifted(situation: _Situation, pose: Pose, duration: float = 0.0) -> _Situation:
    """Return the situation in the robot frame at another pose, `duration` [s] on, with the same twist."""
    movers = situation.movers.copy()
    movers[:, :2] = to_robot(movers[:, :2] + duration * movers[:, 2:4], pose)
    movers[:, 2:4] = to_robot(movers[:, 2:4], Pose(0.0, 0.0, pose.yaw))
    path = None if situation.path is None else to_robot(situation.path, pose)
    return _Situation(
        to_robot(situation.subgoal, pose), to_robot(situation.points, pose), movers, situation.twist, path
    )


class MinTime:
    """Drives the safe arc with the least expected time to the subgoal.

    Every pair (v, ω) that is reachable within a period is tried: it is held for some time, then the robot turns to the
    subgoal and drives there. An arc is safe if the exact footprint, with a margin that grows with speed, reaches no
    obstacle point before the robot has stopped. If none is safe, the robot brakes on its current arc. Where the guide
    finds no free way, and no forward command is faster than backing up, the robot backs up on an arc and later makes
    a `MultiPointTurn`. The points are those that the guide knows, else those of the scan. If the delay of commands is
    known, decisions start from where the robot will be after it. Tracked people are predicted at their current
    velocity.

    A robot that can stop without touching a point never gets a command after which it could not
    (docs/understand/safety.md).
    """

    Config = MinTimeConfig

    def __init__(self, config: MinTimeConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._lag = Lag(config.lag, robot.dt)
        fractions = turn_shares(_RATES)
        slow_ones = np.linspace(0.0, 1.0, _SPEEDS) ** 2  # denser at low speed
        self._fractions = slow_ones, fractions * np.abs(fractions)  # and near the current turn rate
        self._check = StoppingCheck(robot.footprint, robot.dt, config.latency, config.lag)
        self._extra_stop_time = max(config.lag, robot.settling_time)  # [s] by which the drive stops later
        # Until it settles, the robot may be faster than its command by half, so the outline is uncertain by that much.
        self._margin_time = max(config.margin_time, robot.settling_time / 2)
        self._turn = (
            MultiPointTurn(robot.footprint, robot.dt, config.margin) if config.parts.multi_point else None
        )
        self.reset(np.random.default_rng(0))

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the commands; `rng` is not used."""
        self._commanded_omega = 0.0  # [rad/s] last commanded turn rate, before the lag is compensated
        self._left_to_back_up = 0.0  # [m] still to back up
        self._slow_for = 0.0  # [s] with no free way and no command ahead faster than backing up
        self._backed_up = math.inf  # [s] since it last began to
        self._check.reset()
        if self._turn is not None:
            self._turn.reset()

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        measured, limits = self._measured_situation(observation, guidance), observation.limits
        situation = self._situation_ahead(measured, limits)
        # Choose a command: a multi-point turn, the best arc, or backing up if stuck and if what is behind is seen.
        desired = self._multi_point_turn(guidance, situation, limits)
        if desired is None:
            desired = self._best(situation, limits)
            sees_back = guidance.points is not None or is_full_circle(observation.scan)
            backs_up = self._config.parts.backing_up and sees_back
            if backs_up and self._left_to_back_up <= 0.0:
                backs_up = self._is_stuck(desired, guidance, situation, limits)
            if backs_up:
                desired = self._back_up(situation, limits) or desired
        reached = reachable(*desired, situation.twist, limits, self._robot.dt)
        self._commanded_omega = float(reached.omega)
        dt = self._robot.dt
        # Compensate the lag, then replace the command if the robot could not stop after it.
        command = limited(*self._lag.command_for(reached, situation.twist, limits), observation, dt)
        command = self._stoppable(command, StoppingState.of(observation, measured.points))
        command = limited(*command, observation, dt)
        self._check.sent(command)
        return command

    def _multi_point_turn(self, guidance: Guidance, situation: _Situation, limits: Limits) -> Twist | None:
        """Return the command of a multi-point turn, if the guide knows points and way and nobody is in sight."""
        if self._turn is None:
            return None
        if guidance.points is None or situation.path is None or len(situation.movers):
            self._turn.reset()
            return None
        command = self._turn.command(
            guidance.blocked, situation.points, situation.path, situation.twist, limits
        )
        if command is not None:
            self._left_to_back_up = self._slow_for = 0.0
            self._backed_up += self._robot.dt
        return command

    def _is_stuck(self, best: Twist, guidance: Guidance, situation: _Situation, limits: Limits) -> bool:
        """Return whether to begin to back up: at once, but not repeatedly while turning out of a narrow place.

        Where the guide has a free way, a robot counts as stuck only after standing still for a while, and never at
        the subgoal or among movers.
        """
        standing = not any(best)
        blocked = guidance.blocked and best.v < self._backward(limits)
        waits = len(situation.movers) > 0 or math.hypot(*situation.subgoal.tolist()) <= _BACK
        is_slow = blocked or (standing and not waits)
        # Time with no good command ahead, and since the robot last began to back up.
        self._slow_for = self._slow_for + self._robot.dt if is_slow else 0.0
        self._backed_up += self._robot.dt
        long_ago, impatient = self._backed_up > _BACK_INTERVAL, self._slow_for > _PATIENCE
        is_stuck = (blocked and (standing or long_ago or impatient)) or (is_slow and long_ago and impatient)
        if is_stuck:
            self._backed_up = 0.0
        return is_stuck

    def _stoppable(self, command: Twist, stopping: StoppingState) -> Twist:
        """Return the command, or the nearest one after which the robot can still stop, if it can stop now."""
        check = self._check
        for state in (stopping, stopping.as_measured()):
            if check.stops(STILL, state):
                return command if check.stops(command, state) else check.nearest(command, state) or STILL
        return command

    def _measured_situation(self, observation: Observation, guidance: Guidance) -> _Situation:
        """Return the current situation. With known latency or lag, motion is predicted from the measured twist.

        Otherwise, a robot that moves faster than its command is assumed to be where the excess takes it within its
        settling time.
        """
        predicts = self._check.under_way or self._config.lag
        start = observation.limits.clamped(observation.twist) if predicts else observation.ramp_start
        situation = _Situation(
            guidance.subgoal, *self._obstacles(observation, guidance), without_tiny_rates(start), guidance.way
        )
        time = self._robot.settling_time
        if predicts or time == 0.0 or observation.twist == start:
            return situation
        # Amounts by which the measured rates exceed the commanded ones.
        excess = [
            measured - commanded if abs(measured) > abs(commanded) else 0.0
            for measured, commanded in zip(observation.twist, start, strict=True)
        ]
        shift = Pose(time * excess[0], 0.0, time * excess[1])
        return _shifted(situation, shift) if any(excess) else situation

    def _situation_ahead(self, situation: _Situation, limits: Limits) -> _Situation:
        """Return the situation in which the next command takes effect, in the robot frame of that time."""
        if not self._check.under_way:
            return situation
        pose, twist = self._predict(situation.twist, limits)
        return _shifted(situation, pose, self._config.latency)._replace(twist=twist)

    def _obstacles(self, observation: Observation, guidance: Guidance) -> tuple[Floats, Floats]:
        """Return the points that do not move (M, 2), and the movers (P, 5)."""
        if guidance.points is not None and not len(observation.pedestrians):
            return guidance.points, _NOBODY
        scan_points = obstacle_points(observation.scan, self._robot.lidar.mount)
        points = scan_points if guidance.points is None else guidance.points
        is_mover, movers = movers_among(points, scan_points, observation.pedestrians, WIDEST)
        return points[~is_mover], movers

    def _predict(self, start: Twist, limits: Limits) -> tuple[Pose, Twist]:
        """Predict pose, in the current robot frame, and twist for when the next command takes effect."""
        pose, dt = Pose(0.0, 0.0, 0.0), self._robot.dt
        sent = self._check.under_way
        remaining = self._config.latency - (len(sent) - 1) * dt  # of the oldest command
        for k, command in enumerate(sent):
            duration = dt if k else remaining
            reached = self._lag.after(start, command, duration)
            # Plain tuples, as in `FastSimulator.step`.
            motion = (*pose,), (*start,), (*reached,), limits.bounds
            poses, twist = drive(*motion, duration, _STEP, self._robot.footprint.circumscribed_radius)
            pose, start = Pose(*poses[-1].tolist()), Twist(*twist)
        return pose, without_tiny_rates(start)

    def weighed(self, observation: Observation, guidance: Guidance) -> Weighed:
        """Return every arc with its time, but no backing up or multi-point turn; see `Weighed`."""
        limits = observation.limits
        situation = self._situation_ahead(self._measured_situation(observation, guidance), limits)
        ahead, *arguments = self._arguments(situation, limits)
        v, omega, alpha = tried(
            ahead, self._fractions, self._robot.dt, arguments[1], arguments[2], situation.movers
        )
        costs = np.array(
            [
                [best_twist(v[[i]], omega[[j]], alpha, *arguments)[2] for j in range(len(omega))]
                for i in range(len(v))
            ]
        )
        costs[(v[:, None] * np.abs(omega) > self._config.max_lateral_accel) & (v > v[0])[:, None]] = np.inf
        commands = np.stack(np.broadcast_arrays(v[:, None], omega), axis=-1).reshape(-1, 2)
        return Weighed(commands, costs.ravel(), _HORIZON)

    def _best(self, situation: _Situation, limits: Limits) -> Twist:
        """Return the safe command with the least expected time; if none is safe, brake on the current arc."""
        window, *arguments = self._arguments(situation, limits)
        v, omega, time, slowest = best_command(window, self._fractions, *arguments)
        if math.isfinite(time):
            return Twist(v, omega)
        twist = situation.twist
        return Twist(0.0, twist.omega * slowest / twist.v if twist.v > 0.0 else 0.0)

    def _arguments(self, situation: _Situation, limits: Limits) -> tuple[Any, ...]:
        """Return the arguments of `best_command` but the shares, with its named tuples as plain ones."""
        config, dt = self._config, self._robot.dt
        subgoal, points, movers, twist, _ = situation
        lowest, highest = self._lag.reach(twist, limits)
        calm = _CALM if config.parts.calm else math.inf
        window = (*twist,), (*lowest,), (*highest,), limits.bounds[2:], calm, _NEAR, self._commanded_omega
        estimate = limits.v_max, _TURN, dt, max(_HORIZON, dt), _SLOW
        brake = min(config.brake, limits.alpha_v)
        safety = config.margin, self._margin_time, brake, config.max_lateral_accel, self._extra_stop_time
        return window, subgoal, points, self._robot.footprint.box, estimate, safety, movers

    def _backward(self, limits: Limits) -> float:
        """Speed at which the robot backs up [m/s]."""
        return min(_BACKWARD * limits.v_max, -limits.lowest)

    def _back_up(self, situation: _Situation, limits: Limits) -> Twist | None:
        """Back up `_BACK` or more on the safe arc of least expected time to the subgoal; None: none is safe."""
        speed = self._backward(limits)
        omega = self._turns_back(speed, situation.twist.omega, limits) if speed > 0.0 else np.empty(0)
        safe = omega[self._is_safe_back(speed, omega, situation.points, limits)]
        if not len(safe):
            self._left_to_back_up = 0.0
            return None
        # Count down the distance to back up, or start it.
        remaining = self._left_to_back_up if self._left_to_back_up > 0.0 else _BACK
        self._left_to_back_up = remaining - speed * self._robot.dt
        return Twist(-speed, float(safe[self._times_back(speed, safe, situation.subgoal, limits).argmin()]))

    def _turns_back(self, speed: float, omega: float, limits: Limits) -> Floats:
        """Turn rates (W,) within a period of `omega` at which the robot may back up [rad/s], with 0 if possible."""
        (_, lowest), (_, highest) = self._lag.reach(Twist(0.0, omega), limits)
        change, grip = limits.alpha_omega * self._robot.dt, self._config.max_lateral_accel / speed
        low, high = max(omega - change, lowest, -grip), min(omega + change, highest, grip)
        turns = np.linspace(low, high, _ARCS) if low < high else np.array([omega])
        if low <= 0.0 <= high:
            turns[np.abs(turns).argmin()] = 0.0
        return turns

    def _is_safe_back(self, speed: float, omega: Floats, points: Floats, limits: Limits) -> NDArray[np.bool_]:
        """Return whether backing up at each turn rate (W,), and stopping, keeps the margin: (W,)."""
        config, box = self._config, self._robot.footprint.box
        braking = speed / min(config.brake, limits.alpha_v)
        stop = np.maximum(braking, np.abs(omega) / (2.0 * limits.alpha_omega)) + self._extra_stop_time
        horizons, margins = self._robot.dt + stop, np.full(len(omega), config.margin)
        ahead = np.column_stack((np.full(len(omega), speed), -omega))  # backwards, among mirrored points
        contacts = first_contacts(ahead, points * [-1.0, 1.0], box, margins, horizons, horizons, KEPT)
        safe: NDArray[np.bool_] = contacts >= horizons
        return safe

    def _times_back(self, speed: float, omega: Floats, subgoal: Floats, limits: Limits) -> Floats:
        """Expected time to the subgoal (W,) after having backed up at each turn rate for the horizon [s]."""
        duration = max(_HORIZON, self._robot.dt)
        half = 0.5 * omega * duration
        chord = -speed * duration * np.sinc(half / math.pi)
        x, y = subgoal[0] - chord * np.cos(half), subgoal[1] - chord * np.sin(half)
        heading = omega * (duration + np.abs(omega) / (2.0 * limits.alpha_omega))
        turn = np.abs((np.arctan2(y, x) - heading + math.pi) % (2.0 * math.pi) - math.pi)
        times: Floats = np.hypot(x, y) / limits.v_max + _TURN * turn
        return times


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
