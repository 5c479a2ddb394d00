"""Check twists of odometry messages against the slope of their poses: a driver may mean another frame or unit."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from lme.geometry.frames import relative
from lme.live.messages import SECOND
from lme.types import Floats, Pose, Twist

_WINDOW_S = 1.0  # time over which motion is compared: it averages a walking robot's ripple and the noise
_MOVING_S = 0.5  # time over which the poses must move, twice in a row, as a jump does not
_LONGEST_GAP_S = 0.5  # between poses; over a longer one a twist says little about the motion
_SLOWEST = (0.15, 0.2)  # [m/s], [rad/s] below both the robot counts as standing
_TOLERANCES = (0.1, 0.15)  # [m/s], [rad/s] differences up to these never count as wrong
_FRACTION = 0.25  # nor do differences up to this share of the motion
_COMPARED, _MIN_WRONG = 5, 4  # windows with motion that are compared, and how many of them must be wrong


class TwistCheck:
    """A comparison of the poses and twists of one source, taken in order.

    One wrong window is no contradiction: the pose may jump at a loop closure or a reset. Twists that have all been
    zero, as of a driver that never sets them, are found within about a second of motion, others in four to five.
    """

    def __init__(self) -> None:
        self._previous: tuple[int, Pose, Twist] | None = None
        self._sums = np.zeros(5)  # time; way ahead and turn by the poses; the same by the twists
        self._windows: deque[tuple[bool, tuple[float, ...]]] = deque(maxlen=_COMPARED)
        self._all_zero = True
        self._motion = np.zeros(3)  # time; way ahead and turn by the poses
        self._velocities: deque[Floats] = deque(maxlen=2)  # by the poses, while all twists are zero

    def add(self, stamp: int, pose: Pose, twist: Twist) -> None:
        """Compare one more motion. stamp: [ns]. pose: in the odometry frame. twist: as the message has it."""
        previous, self._previous = self._previous, (stamp, pose, twist)
        self._all_zero = self._all_zero and twist == (0.0, 0.0)
        seconds = (stamp - previous[0]) / SECOND if previous else 0.0
        # After a gap, or a stamp that is not later, both windows begin anew.
        if previous is None or not 0.0 < seconds <= _LONGEST_GAP_S:
            self._sums[:] = self._motion[:] = 0.0
            self._velocities.clear()
            return
        # The velocity of the poses alone shows whether twists that are always zero are wrong.
        motion = relative(pose, previous[1])
        self._motion += (seconds, motion.x, motion.yaw)
        if self._motion[0] >= _MOVING_S:
            self._velocities.append(self._motion[1:] / self._motion[0])
            self._motion[:] = 0.0
        # Sum the motion by the poses, and by the twists (trapezoidal rule), until the window is full.
        means = [(earlier + later) / 2 for earlier, later in zip(previous[2], twist, strict=True)]
        self._sums += np.array((seconds, motion.x, motion.yaw, *(seconds * mean for mean in means)))
        if self._sums[0] < _WINDOW_S:
            return
        v, omega, twist_v, twist_omega = (float(number) for number in self._sums[1:] / self._sums[0])
        self._sums[:] = 0.0
        if not max(abs(v), abs(twist_v)) < _SLOWEST[0] or not max(abs(omega), abs(twist_omega)) < _SLOWEST[1]:
            right = _is_near(v, twist_v, _TOLERANCES[0]) and _is_near(omega, twist_omega, _TOLERANCES[1])
            self._windows.append((not right, (v, omega, twist_v, twist_omega)))

    @property
    def full(self) -> bool:
        """Return whether as many windows with motion have been compared as are kept."""
        return len(self._windows) == _COMPARED

    def contradiction(self, at_end: bool = False) -> str | None:
        """Describe the contradiction between twists and poses; None if there is none.

        at_end: nothing more comes, so fewer windows decide, if all are wrong.
        """
        if self._all_zero and len(self._velocities) == 2:
            earlier, later = self._velocities
            same_direction = earlier * later > 0.0  # not out and back, as one wrong pose
            if (same_direction & (np.minimum(np.abs(earlier), np.abs(later)) >= _SLOWEST)).any():
                v, omega = (earlier + later) / 2.0
                return (
                    f"its twist is always zero, but its poses move ({v:.2f} m/s, {omega:.2f} rad/s), so velocities are "
                    "taken from the poses; topics.twist=poses does so from the start"
                )
        wrong = [numbers for is_wrong, numbers in self._windows if is_wrong]
        if len(wrong) < _MIN_WRONG and not (at_end and len(wrong) == len(self._windows) > 1):
            return None
        v, omega, twist_v, twist_omega = np.mean(wrong, axis=0)
        return (
            f"its twists contradict its poses (on average {twist_v:.2f} m/s and {twist_omega:.2f} rad/s in the twists, "
            f"{v:.2f} m/s and {omega:.2f} rad/s in the poses), so velocities are taken from the poses; a twist must be "
            "in the frame of the robot (child_frame_id), in m/s and rad/s"
        )


def _is_near(number: float, reported: float, tolerance: float) -> bool:
    return math.isfinite(reported) and abs(number - reported) <= max(tolerance, _FRACTION * abs(number))
