"""Check of the observations that a user's own program gives to a navigator.

A mistake there, such as ranges in millimetres, looks like free space, and the robot would drive into a wall.
"""

from __future__ import annotations

import math
import warnings

from lme.geometry.frames import wrap_angle
from lme.inputs.returned import ReturnedError, given_observation
from lme.perception.scan_check import scan_faults
from lme.robots import Lidar
from lme.types import LaserScan, Limits, Observation, Pose

_WHOLE = 0.9  # share of the robot's field of view that a whole scan covers at least
_SURPLUS = 3.0  # times the motion at the limits, which no robot makes in a control period,
_JUMP_M, _JUMP_RAD = 0.1, 0.2  # and more than a correction of the pose
_MOST_JUMPS = 5  # periods with such a motion, less those without


class ObservationCheck:
    """Refuses observations that cannot be used, and scans on which a robot must not drive.

    The first scan, and the first of another geometry, is checked in full. Odometry that moves in period after period as
    no robot can gets one warning.
    """

    def __init__(self, lidar: Lidar, dt: float | None) -> None:
        """lidar: of the robot that the navigator was made for. dt: its control period [s]; None: unknown."""
        self._lidar, self._dt = lidar, dt
        self._geometry: tuple[float, ...] = ()
        self._odometry: Pose | None = None
        self._jumps = 0

    def checked(self, observation: object) -> Observation:
        """Return the observation, with arrays of floats. Raises ReturnedError; warns of what is odd."""
        given = given_observation(observation)
        scan = given.scan
        geometry = len(scan.ranges), *scan[1:]
        # Where no beam measures anything, the comparison with NaN is false as well.
        is_new = geometry != self._geometry
        if is_new or not scan.ranges.max() > scan.range_min:
            self._check(scan, is_new)
            self._geometry = geometry
        if self._dt is not None and self._jumps < _MOST_JUMPS:
            self._compare(given.odometry, given.limits, self._dt)
        return given

    def _compare(self, odometry: Pose, limits: Limits, dt: float) -> None:
        """Warn if the odometry has moved too far since the last period, as it has in several before."""
        last, self._odometry = self._odometry, odometry
        if last is None:
            return
        moved, turned = math.dist(odometry[:2], last[:2]), abs(wrap_angle(odometry.yaw - last.yaw))
        is_jump = moved > _SURPLUS * limits.v_max * dt + _JUMP_M
        is_jump = is_jump or turned > _SURPLUS * limits.omega_max * dt + _JUMP_RAD
        self._jumps = self._jumps + 1 if is_jump else max(self._jumps - 1, 0)
        if self._jumps == _MOST_JUMPS:
            warnings.warn(
                f"the odometry moves by {moved:.3g} m and turns by {turned:.3g} rad in a control period of {dt:g} s, "
                f"where the robot's limits are {limits.v_max:g} m/s and {limits.omega_max:g} rad/s: must be in metres "
                "and radians, and new in each control period",
                stacklevel=5,
            )

    def _check(self, scan: LaserScan, warns: bool) -> None:
        count = len(scan.ranges)
        if not count:
            raise ReturnedError("the scan has no ranges: must have one for each beam")
        if count > 1 and scan.angle_increment == 0.0:
            raise ReturnedError(f"the scan of {count} beams has an angle_increment of 0: must not be 0 [rad]")
        if not scan.range_max > scan.range_min >= 0.0:
            raise ReturnedError(
                f"the scan has range_min {scan.range_min:g} and range_max {scan.range_max:g}: must be at least 0, and "
                "greater than range_min [m]"
            )
        for fault in scan_faults(scan, scan):
            if fault.blind:
                raise ReturnedError(fault.text)
            if warns:
                warnings.warn(fault.text, stacklevel=5)
        fov = min(count * abs(scan.angle_increment), math.tau)
        if warns and fov < _WHOLE * self._lidar.fov:
            warnings.warn(
                f"the scan of {count} beams covers {math.degrees(fov):.3g}°, the robot's lidar "
                f"{math.degrees(self._lidar.fov):.3g}°: give all beams, or a robot with this lidar",
                stacklevel=5,
            )
