"""Motion of the robot since the last observation, by the better of two sources: its twist and its odometry."""

from __future__ import annotations

import math
from typing import NamedTuple

from lme.geometry.frames import relative
from lme.types import Limits, Observation, Pose, Twist

_SLACK = 1e-3  # [m, rad] by which the poses may differ from a twist that explains them,
_RELATIVE_SLACK = 0.02  # and share of the motion by which they may differ besides


class Move(NamedTuple):
    """The motion of one control period.

    before, now: the twists at its ends. pose: of the base now in its frame one period before, by odometry, if that is
    the better source; None if the twists are.
    """

    before: Twist
    now: Twist
    pose: Pose | None

    @property
    def reports_no_speed(self) -> bool:
        """Return whether the twist is exactly zero at both ends of a motion that the poses show."""
        return self.pose is not None and not (any(self.before) or any(self.now)) and any(self.pose)


class DeadReckoning:
    """Motion of the base from observation to observation.

    The twists are used, as in the paper (UpdatePos, §III.D), for as long as they explain the odometry: while a ramp
    from one twist to the next leads from one pose to the next. From the first period in which it does not, the poses
    are used: the twist may always be zero, sway with the gait, come from wheels that slip or itself be the velocity
    between two poses, which lags by half a period, or the period may differ from `dt`. An odometry that does not
    change while the twist reports motion counts as missing.
    """

    def __init__(self, dt: float) -> None:
        """dt: control period [s]."""
        self._dt = dt
        self.by_poses = False
        self._previous: tuple[Twist, Pose] | None = None

    def move(self, observation: Observation) -> Move | None:
        """Return the motion since the last observation; None at the first one."""
        twist, odometry = observation.twist, observation.odometry
        if self._previous is None:
            self._previous = twist, odometry
            return None
        (previous, former), self._previous = self._previous, (twist, odometry)
        if odometry == former and any(twist):
            return Move(previous, twist, None)
        pose = relative(odometry, former)
        self.by_poses = self.by_poses or not self._explained(pose, previous, twist, observation.limits)
        return Move(previous, twist, pose if self.by_poses else None)

    def velocity(self, move: Move) -> Twist:
        """Mean velocity of a motion."""
        if move.pose is None:
            return Twist((move.before.v + move.now.v) / 2, (move.before.omega + move.now.omega) / 2)
        return Twist(move.pose.x / self._dt, move.pose.yaw / self._dt)

    def _explained(self, pose: Pose, previous: Twist, twist: Twist, limits: Limits) -> bool:
        """Return whether a drive that ramps from one twist to the next, and then holds it, can move the base so."""
        # Length of the arc that leads to the pose: chord · (θ/2) / sin(θ/2).
        half_turn = pose.yaw / 2
        chord = pose.x * math.cos(half_turn) + pose.y * math.sin(half_turn)
        arc = chord if half_turn == 0.0 else chord * half_turn / math.sin(half_turn)
        return _ramps(arc, previous.v, twist.v, limits.alpha_v, self._dt) and _ramps(
            pose.yaw, previous.omega, twist.omega, limits.alpha_omega, self._dt
        )


def _ramps(motion: float, initial: float, final: float, alpha: float, dt: float) -> bool:
    """Return whether a ramp from `initial` to `final`, at `alpha` or slower, can move the robot by `motion` in `dt`."""
    change = abs(final - initial)
    # Difference from `final` throughout: change² / (2 α) for the fastest ramp, change · dt / 2 for the slowest.
    shortfall = math.copysign(1.0, final - initial) * (final * dt - motion)
    slack = _RELATIVE_SLACK * abs(motion) + _SLACK
    return change**2 / (2 * alpha) - slack <= shortfall <= change * dt / 2 + slack
