"""Check of the observations that a user's own program gives to a navigator.

A mistake there, such as ranges in millimetres, looks like free space, and the robot would drive into a wall.
"""

from __future__ import annotations

import math
import warnings

from lme.inputs.returned import ReturnedError, given_observation
from lme.perception.scan_check import scan_faults
from lme.robots import Lidar
from lme.types import LaserScan, Observation

_WHOLE = 0.9  # share of the robot's field of view that a whole scan covers at least


class ObservationCheck:
    """Refuses observations that cannot be used, and scans on which a robot must not drive.

    The first scan, and the first of another geometry, is checked in full.
    """

    def __init__(self, lidar: Lidar) -> None:
        """lidar: of the robot that the navigator was made for."""
        self._lidar = lidar
        self._geometry: tuple[float, ...] = ()

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
        return given

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
