"""Conversion of scans and point clouds of any lidar to scans of the robot's lidar."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from lme.errors import InputError
from lme.live.clouds import CloudReader
from lme.live.config import ScanConfig, mount_of
from lme.live.frames import Carrier
from lme.live.messages import frame, is_cloud, planar_matrix, scan_of
from lme.live.poses import Posture, StampedMotion
from lme.perception.resampling import own_lidar, resampled, same_lidar, tidied
from lme.perception.scan_check import ScanFault, check_unit_of_angles, scan_faults
from lme.perception.shadows import without_shadows
from lme.robots import Lidar, Robot
from lme.types import Floats, LaserScan, Observation, Pose, Twist

_FINER = 2.5  # a lidar with this many times as many beams per angle as in the first message is a finer one
_NARROWER = 0.9  # share of the widest field of view so far that a whole scan covers at least
_TILT_WARNED, _TILT_REFUSED = math.radians(10.0), math.radians(45.0)  # of a planar lidar


class ScanSource:
    """A converter of messages to scans of the lidar of `robot`.

    first: the first message. mount: (4, 4) from its frame to the base frame, by tf; None if tf has none. carrier:
    what its frame moves with. posture, in all methods: posture of the base at the stamp of a cloud; None if not
    known, and for a LaserScan. With lidar "recorded", the robot gets the lidar of the first message; with "robot", it
    keeps its own, and scans are resampled. Ranges of a scan with exactly the geometry of the lidar stay the same to
    the last bit.
    """

    def __init__(
        self,
        config: ScanConfig,
        first: Any,
        mount: Floats | None,
        robot: Robot,
        carrier: Carrier = Carrier.BASE,
    ) -> None:
        """Read mount and lidar from the first message.

        Raises InputError if the message is not valid, or if its mount is not known well enough.
        """
        self._config = config
        self.carrier = carrier
        self._spare_range, self._outline = robot.lidar.range_max, robot.footprint.circumscribed_radius
        self._frame = frame(first.header.frame_id)
        self._warned: set[str] = set()  # kinds of faults
        # Find the mount. Scans of clouds are already in the base frame; a planar lidar may be upside down.
        self._clouds = CloudReader(config, mount, robot, self._frame, carrier) if is_cloud(first) else None
        if self._clouds is not None:
            self.mounted_by = self._clouds.mounted_by
            self._pose, self.upside_down = Pose(0.0, 0.0, 0.0), False
        else:
            self.mounted_by, matrix = mount_of(config, mount, robot, 0.0)
            _check_level(matrix, self.mounted_by)
            self._pose, self.upside_down = planar_matrix(matrix)
            check_unit_of_angles(scan_of(first))
            self._widest = _fov(first)  # [rad]
        # Give the robot the lidar of the first message, unless it keeps its own.
        raw = self.raw(first)
        lidar = self._lidar_of(raw)
        if config.lidar == "recorded" and not same_lidar(lidar, robot.lidar):
            kept = {key: getattr(robot.lidar, key) for key in ("noise_std", "shadow_angle")}
            with _quietly():
                robot = replace(robot, lidar=replace(lidar, **kept))
        self.robot = robot
        self._geometry: tuple[float, ...] = ()
        self._native = self._unchanged = False

    @property
    def mount(self) -> Pose:
        """The pose, in the base frame, of the frame of `raw` scans; for point clouds that is the base itself."""
        return self._pose

    def read(self, message: Any, posture: Posture | None = None) -> LaserScan:
        """Return the scan of a LaserScan or PointCloud2 message, as a scan of the robot's lidar.

        Warns of each kind of fault once.
        """
        raw, lidar = self.raw(message, posture), self.robot.lidar
        self.warn_of_faults(message, raw, posture)
        # Compare the geometry with the lidar's only if it is not that of the last message.
        geometry = (len(raw.ranges), *raw[1:])
        if geometry != self._geometry:
            self._geometry = geometry
            self._native = same_lidar(self._lidar_of(raw), lidar)
            self._unchanged = self._native and self._needs_no_conversion(raw)
        scan = _scan_of_lidar(lidar, raw.ranges) if self._unchanged else tidied(raw, self.upside_down)
        # Drop returns between two surfaces, also those that an interpolation adds.
        if lidar.shadow_angle is not None:
            scan = without_shadows(scan, lidar.shadow_angle)
        if self._native:
            return _scan_of_lidar(lidar, scan.ranges)
        scan = resampled(scan, self._pose, lidar)
        return scan if lidar.shadow_angle is None else without_shadows(scan, lidar.shadow_angle)

    def observation(
        self,
        message: Any,
        motion: StampedMotion,
        target: Floats,
        last_command: Twist,
        posture: Posture | None = None,
    ) -> Observation:
        """The input of guide and planner: the scan of a message, and pose, twist and target (2,) [m] at its stamp.

        last_command: the command that the robot follows now. posture: posture of the base, which levels a cloud.
        """
        limits, scan = self.robot.limits, self.read(message, posture)
        return Observation(scan, target, motion.twist, limits, motion.pose, last_command=last_command)

    def exceeded_by(self, message: Any) -> bool:
        """Return whether a message shows a wider or much finer lidar than the first, which then was no whole scan."""
        if self._clouds is not None or self._config.lidar == "robot":
            return False
        lidar, increment, fov = self.robot.lidar, abs(float(message.angle_increment)), _fov(message)
        wider = fov > lidar.fov + 2.0 * lidar.angle_increment
        return wider or (fov >= lidar.fov and _FINER * increment < lidar.angle_increment)

    def blinding_fault(self, message: Any, posture: Posture | None = None) -> str | None:
        """Return the reason not to drive on a message, although it measures something; None if there is none.

        Raises InputError if the angles are in degrees.
        """
        faults = self._faults(message, self.raw(message, posture), posture)
        return next((fault.text for fault in faults if fault.blind), None)

    def warn_of_faults(self, message: Any, raw: LaserScan, posture: Posture | None = None) -> None:
        """Warn of every kind of fault that no message had before. raw: of this message."""
        for fault in self._faults(message, raw, posture):
            if fault.kind not in self._warned:
                self._warned.add(fault.kind)
                warnings.warn(fault.text, stacklevel=3)

    def raw(self, message: Any, posture: Posture | None = None) -> LaserScan:
        """The scan of a message in its own geometry, with valid range limits."""
        if self._clouds is not None:
            return self._clouds.scan(message, posture)
        scan, config = scan_of(message), self._config
        low = scan.range_min if config.range_min is None else config.range_min
        high = scan.range_max if config.range_max is None else config.range_max
        low = max(low, 0.0) if math.isfinite(low) else 0.0
        return scan._replace(range_min=low, range_max=high if low < high < math.inf else self._spare_range)

    def _lidar_of(self, raw: LaserScan) -> Lidar:
        """The lidar that measured a scan."""
        with _quietly():
            return own_lidar(tidied(raw, self.upside_down), self._pose)[0]

    def _faults(self, message: Any, raw: LaserScan, posture: Posture | None) -> list[ScanFault]:
        scan_frame = frame(message.header.frame_id)
        if scan_frame != self._frame:
            text = f"a scan comes from the frame {scan_frame}, not from {self._frame}: another lidar on the same topic"
            return [ScanFault("frame", text, True)]
        if self._clouds is not None:
            return self._clouds.faults(message, raw, posture)
        angle_max = getattr(message, "angle_max", None)
        last_angle = None if angle_max is None else float(angle_max)
        faults = scan_faults(scan_of(message), raw, last_angle, self._outline)
        if self._config.range_max is not None:
            faults = [fault for fault in faults if fault.kind != "range_max"]
        return faults + self._size_faults(message)

    def _size_faults(self, message: Any) -> list[ScanFault]:
        """Faults of a message that covers much less than the widest so far, or more than the lidar."""
        lidar, fov = self.robot.lidar, _fov(message)
        size = f"a scan of {len(message.ranges)} beams covers {math.degrees(fov):.3g}°"
        if self._config.lidar == "recorded" and fov > lidar.fov + 2.0 * lidar.angle_increment:
            text = f"{size}, the lidar {math.degrees(lidar.fov):.3g}°: what it sees beyond is lost"
            return [ScanFault("wider", text, True)]
        if fov > self._widest:
            self._widest = fov
        if fov < _NARROWER * self._widest:
            text = f"{size}, others {math.degrees(self._widest):.3g}°: it is not a whole scan"
            return [ScanFault("narrower", text, True)]
        return []

    def _needs_no_conversion(self, raw: LaserScan) -> bool:
        """Return whether the ranges need no conversion: same beams in the same order, and 0 is not a valid range."""
        lidar = self.robot.lidar
        first = math.isclose(raw.angle_min, lidar.angle_min, abs_tol=1e-5)
        upright = raw.angle_increment > 0.0 and not self.upside_down
        return first and upright and len(raw.ranges) == lidar.num_beams and lidar.range_min > 0.0


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Build the lidar of a message without the warnings for a robot's file: `scan_faults` says what is odd about it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def _check_level(matrix: Floats, source: str) -> None:
    """Warn if a planar lidar is tilted. Raises InputError if it is on its side; it may be upside down."""
    tilt = math.acos(min(abs(float(matrix[2, 2])), 1.0))
    tilted = (
        f"{source} tilts the lidar by {math.degrees(tilt):.0f}°, but a LaserScan must be level or upside down"
    )
    right = "correct roll and pitch of its transform, or set scan.mount=[x, y, z, roll, pitch, yaw] [m, rad]"
    if tilt > _TILT_REFUSED:
        raise InputError(f"{tilted}: {right}")
    if tilt > _TILT_WARNED:
        warnings.warn(f"{tilted}: its beams are read as if it were level; {right}", stacklevel=3)


def _fov(message: Any) -> float:
    """The field of view of a LaserScan [rad], at most a full circle."""
    return min(len(message.ranges) * abs(float(message.angle_increment)), math.tau)


def _scan_of_lidar(lidar: Lidar, ranges: Any) -> LaserScan:
    return LaserScan(
        np.ascontiguousarray(ranges, np.float32),
        lidar.angle_min,
        lidar.angle_increment,
        lidar.range_min,
        lidar.range_max,
    )
