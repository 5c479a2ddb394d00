"""Faults of scans that would otherwise be read as free space or as walls that do not exist."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import InputError
from lme.types import LaserScan

_MOST_TURNS = 1.5  # a scan of more turns is two scans in one message
_DEGREES_TURNS = 3.5  # more turns than that are degrees: 22 rad, as 22° are a narrow lidar
_DEGREES_START = 2.0 * math.tau  # [rad] an angle_min beyond this is in degrees
_OFF_BEAMS = 1.5  # drivers disagree on whether angle_max is the last beam or the one after it
_ERROR = math.radians(10.0)  # by which angle_max contradicts the increment so far that neither can be trusted
_NEAREST_LIMIT = 5.0  # [m] no lidar is blind up to here
_FARTHEST_LIMIT = 1000.0  # [m] no lidar sees this far
FAR = 100.0  # [m] half of the returns of a robot's lidar are nearer
_TIMES_TOO_FAR = 3.0  # by which readings exceed range_max if their unit is another one
_CODES = 10  # distinct readings beyond range_max that may be codes for "no return"
_MAX_LOST = 0.02  # share of the beams below range_min from which on there is a fault
_MIN_EQUAL = 16  # least number of beams to which no room gives the same range


class ScanFault(NamedTuple):
    """Fault of a scan. blind: a robot must not drive on it. kind: the same for all scans of one fault."""

    kind: str
    text: str
    blind: bool


@dataclass(slots=True)
class ScanTally:
    """Count of beams without a return, and of scans without a single point."""

    beams: int = 0
    beams_without_return: int = 0
    scans_without_point: int = 0

    def add(self, scan: LaserScan) -> None:
        """Add a scan with any code for "no return"."""
        points = int(np.count_nonzero(_returns(scan)))
        self.beams += len(scan.ranges)
        self.beams_without_return += len(scan.ranges) - points
        self.scans_without_point += points == 0

    def __str__(self) -> str:
        return (
            f"{self.beams_without_return} of {self.beams} beams without return, "
            f"{self.scans_without_point} scans without a point"
        )


def scan_faults(
    message: LaserScan, scan: LaserScan, angle_max: float | None = None, outline: float = 0.0
) -> list[ScanFault]:
    """Find the faults of a scan; [] if it is plausible.

    message: the scan as received. scan: with the range limits that are used. angle_max [rad]: of the message, if it has
    one. outline [m]: nearer readings are of the robot itself. Raises InputError for angles in degrees.
    """
    check_unit_of_angles(message)
    return [
        *_angle_faults(message, angle_max),
        *_limit_faults(message, scan),
        *_reading_faults(message, scan, outline),
    ]


def check_unit_of_angles(scan: LaserScan) -> None:
    """Raise InputError if the angles of a scan are in degrees."""
    turns = abs(scan.angle_increment) * len(scan.ranges) / math.tau
    if turns > _DEGREES_TURNS or abs(scan.angle_min) > _DEGREES_START:
        raise InputError(
            f"the scan begins at {scan.angle_min:g} rad and has {len(scan.ranges)} beams with increments of "
            f"{scan.angle_increment:g} rad, which is {turns:.3g} turns: angle_min, angle_max and angle_increment "
            "must be in radians; these look like degrees"
        )


def _angle_faults(scan: LaserScan, angle_max: float | None) -> list[ScanFault]:
    count, increment = len(scan.ranges), abs(scan.angle_increment)
    beams = f"the scan has {count} beams with increments of {math.degrees(increment):.4g}°"
    turns = count * increment / math.tau
    if turns > _MOST_TURNS:
        return [ScanFault("turns", f"{beams}, {turns:.3g} turns: only the first turn is read", True)]
    last_angle = scan.angle_min + (count - 1) * scan.angle_increment
    if angle_max is not None and math.isfinite(angle_max - last_angle):
        difference = math.remainder(angle_max - last_angle, math.tau)
        if abs(difference) > _OFF_BEAMS * increment:
            ends = f"ends at {math.degrees(last_angle):.4g}°, but angle_max is {math.degrees(angle_max):.4g}°"
            text = f"{beams}, so it {ends}: the increment is used, and one of them is wrong"
            blind = abs(difference) > _ERROR and angle_max != 0.0  # 0: the driver left it unset
            return [ScanFault("angle_max", text, blind)]
    if (count - 1) * increment > math.tau + 0.5 * increment:
        text = f"{beams}, {count * math.degrees(increment):.4g}°: beams beyond one turn are left out"
        return [ScanFault("overlap", text, False)]
    return []


def _limit_faults(message: LaserScan, scan: LaserScan) -> list[ScanFault]:
    faults = []
    if scan.range_min >= _NEAREST_LIMIT:
        text = f"range_min is {scan.range_min:g} m: nearer returns are lost; must be in metres, or set scan.range_min"
        faults.append(ScanFault("range_min", text, True))
    if message.range_max != scan.range_max and not message.range_min < message.range_max < math.inf:
        text = f"range_max is {message.range_max:g}, so farther than {scan.range_max:g} m counts as no return"
        faults.append(ScanFault("range_max", f"{text}; if that is wrong, set scan.range_max", False))
    elif scan.range_max >= _FARTHEST_LIMIT:
        text = f"range_max is {scan.range_max:g} m: must be in metres, or set scan.range_max"
        faults.append(ScanFault("range_max", text, False))
    return faults


def _reading_faults(message: LaserScan, scan: LaserScan, outline: float) -> list[ScanFault]:
    ranges = np.asarray(message.ranges, dtype=np.float32)
    if not len(ranges):
        return []
    with np.errstate(invalid="ignore"):
        if not ((ranges > 0.0) & ~(ranges < np.float32(scan.range_min))).any():
            reason = f"all {len(ranges)} are NaN, 0 or below range_min {scan.range_min:g} m"
            return [ScanFault("empty", f"no beam of a scan measures anything: {reason}", True)]
        is_too_near = (ranges > outline) & (ranges < np.float32(scan.range_min))
        is_too_far = np.isfinite(ranges) & (ranges >= np.float32(scan.range_max))
    returns = ranges[_returns(scan)]
    faults: list[ScanFault] = []
    if len(returns) and np.median(returns) > FAR:
        faults.append(_unit_fault(returns, "between range_min and range_max"))
    elif np.count_nonzero(is_too_far) > len(returns) and _in_another_unit(ranges[is_too_far], message):
        faults.append(_unit_fault(ranges[is_too_far], f"beyond range_max {scan.range_max:g} m"))
    number = np.count_nonzero(is_too_near)
    if number >= max(3, _MAX_LOST * len(ranges)) and len(np.unique(ranges[is_too_near])) > 2:
        text = (
            f"{number} of {len(ranges)} beams of a scan read {ranges[is_too_near].min():.3g} to "
            f"{ranges[is_too_near].max():.3g} m, below range_min {scan.range_min:g} m, and are dropped; "
            "if they are right, set scan.range_min"
        )
        faults.append(ScanFault("below range_min", text, bool(number > len(returns))))
    if len(returns) == len(ranges) >= _MIN_EQUAL and (returns == returns[0]).all():
        text = f"all {len(ranges)} beams of a scan read {returns[0]:g} m, as if the lidar measured nothing"
        faults.append(ScanFault("constant", text, False))
    return faults


def _in_another_unit(readings: np.ndarray, message: LaserScan) -> bool:
    """Return whether readings beyond range_max are distances in another unit, not codes for "no return"."""
    range_max = message.range_max if 0.0 < message.range_max < math.inf else FAR / _TIMES_TOO_FAR
    return bool(np.median(readings) > _TIMES_TOO_FAR * range_max) and len(np.unique(readings)) > _CODES


def _unit_fault(readings: np.ndarray, position: str) -> ScanFault:
    text = f"{len(readings)} beams of a scan read {np.median(readings):.4g} m in the median, {position}"
    return ScanFault(
        "unit", f"{text}: ranges must be in metres; these look like millimetres or centimetres", True
    )


def _returns(scan: LaserScan) -> np.ndarray:
    """Return whether each beam has a return within the limits: (num_beams,)."""
    ranges = np.asarray(scan.ranges, dtype=np.float32)
    with np.errstate(invalid="ignore"):
        in_limits = (ranges >= np.float32(scan.range_min)) & (ranges < np.float32(scan.range_max))
        return np.asarray(in_limits & (ranges > 0.0))
