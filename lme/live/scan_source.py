"""Converts scans and point clouds of any lidar to scans of the robot's lidar."""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lme import plausibility
from lme.errors import InputError, require
from lme.live.messages import frame, is_cloud, planar_matrix, scan_of
from lme.live.track import StampedMotion
from lme.robots import Lidar, Robot
from lme.sensing.point_cloud import cloud_points, rigid_transform
from lme.sensing.projection import Projection, to_scan
from lme.sensing.resampling import own_lidar, resampled, same_lidar, tidied
from lme.sensing.scan_check import FAR, ScanFault, check_unit_of_angles, scan_faults
from lme.types import Floats, LaserScan, Observation, Pose, Twist

LIDARS = ("recorded", "robot")
_FINER = 2.5  # times as many beams per angle as in the first message are a finer lidar
_NARROWER = 0.9  # share of the widest field of view so far that a whole scan covers
_HEIGHTS = (0.05, 0.5)  # [m] ASSUMED: above the floor's noise; the robot passes under higher points
_SAME_HEIGHT = 0.1  # [m] to which tf and the robot agree on the height of the lidar
_ON_THE_FLOOR = "base_footprint"  # by REP-120
_BASES = (_ON_THE_FLOOR, "base_link")  # the frames of clouds that are already in the base frame
_TILT_WARNED, _TILT_REFUSED = math.radians(10.0), math.radians(45.0)  # of a planar lidar
_ASK = "set scan.mount=[x, y, z, roll, pitch, yaw] [m, rad], with z above the floor"


@dataclass(slots=True)
class CloudConfig:
    """How a point cloud becomes a scan.

    Heights are above the floor; None: those of robot.lidar.cloud, else 0.05 and 0.5 m. With a negative min_height,
    which only a base frame above the floor can need, they are in the base frame.
    """

    min_height: float | None = None  # [m]
    max_height: float | None = None  # [m]
    angle_increment: float = 0.0087  # [rad]
    range_max: float = 10.0  # [m]


@dataclass(slots=True)
class ScanConfig:
    """How scans are read. mount: [x, y, z [m], roll, pitch, yaw [rad]] of the lidar on the base."""

    lidar: str = "recorded"
    mount: list[float] | None = None
    range_min: float | None = None  # [m]
    range_max: float | None = None  # [m]
    cloud: CloudConfig = field(default_factory=CloudConfig)

    def __post_init__(self) -> None:
        if self.lidar not in LIDARS:
            raise InputError(f"scan.lidar is {self.lidar!r}: must be one of {', '.join(LIDARS)}")
        if self.mount is not None:
            _matrix(self.mount)
            for key, angle in zip(("roll", "pitch", "yaw"), self.mount[3:], strict=True):
                plausibility.check(f"scan.mount.{key}", angle)
        if self.range_min is not None:
            require("scan.range_min", self.range_min, at_least=0.0)
        if self.range_max is not None:
            require("scan.range_max", self.range_max, above=self.range_min or 0.0)
        low, high = self.cloud.min_height, self.cloud.max_height
        if low is not None:
            require("scan.cloud.min_height", low)
        if high is not None:
            require("scan.cloud.max_height", high, above=low)
        require("scan.cloud.angle_increment", self.cloud.angle_increment, above=0.0, at_most=0.5)
        require("scan.cloud.range_max", self.cloud.range_max, above=0.0)


class ScanSource:
    """Turns messages into scans of the lidar of `robot`.

    first: the first message. mount: (4, 4) from its frame to the base frame, by tf; None if tf has none.
    With lidar "recorded", the robot gets the lidar of the first message; with "robot", it keeps its own, and scans
    are resampled. Ranges of a scan with exactly the geometry of the lidar stay the same to the last bit.
    """

    def __init__(self, config: ScanConfig, first: Any, mount: Floats | None, robot: Robot) -> None:
        """Raises InputError if the first message is not valid, or if its mount is not known well enough."""
        self._config = config
        self._cloud = is_cloud(first)
        self._spare_range, self._outline = robot.lidar.range_max, robot.footprint.r_max
        self._frame = frame(first.header.frame_id)
        self._warned: set[str] = set()  # kinds of faults
        if self._cloud:
            self._heights = _heights(config.cloud, robot)
            self.mounted_by, self._matrix = _cloud_mount(config, mount, robot, self._frame)
            self._pose, self.upside_down = Pose(0.0, 0.0, 0.0), False
        else:
            self.mounted_by, self._matrix = _mount(config, mount, robot, 0.0)
            _check_level(self._matrix, self.mounted_by)
            self._pose, self.upside_down = planar_matrix(self._matrix)
            check_unit_of_angles(scan_of(first))
            self._widest = _fov(first)  # [rad]
        raw = self.raw(first)
        seen = self._lidar_of(raw)
        if config.lidar == "recorded" and not same_lidar(seen, robot.lidar):
            with _quietly():
                robot = replace(robot, lidar=replace(seen, noise_std=robot.lidar.noise_std))
        self.robot = robot
        self._geometry: tuple[float, ...] = ()
        self._own = self._untouched = False

    @property
    def mount(self) -> Pose:
        """The pose, in the base frame, of the frame of `raw` scans; of a point cloud's, the base itself."""
        return self._pose

    def read(self, message: Any) -> LaserScan:
        """The scan of a LaserScan or PointCloud2 message, as a scan of the robot's lidar.

        Warns of each kind of fault once.
        """
        raw, lidar = self.raw(message), self.robot.lidar
        self.warn_of_faults(message, raw)
        geometry = (len(raw.ranges), *raw[1:])
        if geometry != self._geometry:
            self._geometry = geometry
            self._own = same_lidar(self._lidar_of(raw), lidar)
            self._untouched = self._own and self._needs_no_conversion(raw)
        if self._untouched:
            return _scan_of_lidar(lidar, raw.ranges)
        scan = tidied(raw, self.upside_down)
        return _scan_of_lidar(lidar, scan.ranges) if self._own else resampled(scan, self._pose, lidar)

    def observation(
        self, message: Any, motion: StampedMotion, target: Floats, last_command: Twist
    ) -> Observation:
        """The input of guide and planner: the scan of a message, and pose, twist and target (2,) [m] at its stamp.

        last_command: what the robot follows now.
        """
        limits, scan = self.robot.limits, self.read(message)
        return Observation(scan, target, motion.twist, limits, motion.pose, last_command=last_command)

    def exceeded_by(self, message: Any) -> bool:
        """Whether a message shows a wider or much finer lidar than the first, which then was not a whole scan."""
        if self._cloud or self._config.lidar == "robot":
            return False
        lidar, increment, fov = self.robot.lidar, abs(float(message.angle_increment)), _fov(message)
        wider = fov > lidar.fov + 2.0 * lidar.angle_increment
        return wider or (fov >= lidar.fov and _FINER * increment < lidar.angle_increment)

    def blinding_fault(self, message: Any) -> str | None:
        """Why a robot must not drive on a message, although it measures something; None if it may.

        Raises InputError if the angles are in degrees.
        """
        faults = self._faults(message, self.raw(message))
        return next((fault.text for fault in faults if fault.blind), None)

    def warn_of_faults(self, message: Any, raw: LaserScan) -> None:
        """Warn of every kind of fault that no message had before. raw: of this message."""
        for fault in self._faults(message, raw):
            if fault.kind not in self._warned:
                self._warned.add(fault.kind)
                warnings.warn(fault.text, stacklevel=3)

    def raw(self, message: Any) -> LaserScan:
        """The scan of a message in its own geometry, with valid range limits."""
        if self._cloud:
            return self._flattened(message)
        scan, config = scan_of(message), self._config
        low = scan.range_min if config.range_min is None else config.range_min
        high = scan.range_max if config.range_max is None else config.range_max
        low = max(low, 0.0) if math.isfinite(low) else 0.0
        return scan._replace(range_min=low, range_max=high if low < high < math.inf else self._spare_range)

    def _lidar_of(self, raw: LaserScan) -> Lidar:
        """The lidar that measured a scan."""
        with _quietly():
            return own_lidar(tidied(raw, self.upside_down), self._pose)[0]

    def _faults(self, message: Any, raw: LaserScan) -> list[ScanFault]:
        came_from = frame(message.header.frame_id)
        if came_from != self._frame:
            text = f"a scan comes from the frame {came_from}, not from {self._frame}: another lidar on the same topic"
            return [ScanFault("frame", text, True)]
        if self._cloud:
            return self._cloud_faults(message, raw)
        angle_max = getattr(message, "angle_max", None)
        last = None if angle_max is None else float(angle_max)
        faults = scan_faults(scan_of(message), raw, last, self._outline)
        if self._config.range_max is not None:
            faults = [fault for fault in faults if fault.kind != "range_max"]
        return faults + self._size_faults(message)

    def _size_faults(self, message: Any) -> list[ScanFault]:
        """Whether the message covers much less than the widest so far, or more than the lidar."""
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

    def _cloud_faults(self, message: Any, raw: LaserScan) -> list[ScanFault]:
        """Whether there are points, but none that counts: they would be taken for free space."""
        if np.isfinite(raw.ranges).any():
            return []
        points = cloud_points(message)
        points = points[np.isfinite(points).all(axis=1) & points.any(axis=1)]
        x, y, z = (points @ self._matrix[:3, :3].T + self._matrix[:3, 3]).T
        distance = np.hypot(x, y)
        z = z[(distance > self._outline) & (distance >= raw.range_min) & (distance <= raw.range_max)]
        if not len(z):
            if not len(distance) or np.median(distance) < FAR:
                return []
            text = f"the {len(points)} points of a cloud are {np.median(distance):.4g} m away in the median"
            return [ScanFault("unit", f"{text}: must be in metres; these look like millimetres", True)]
        low, high = self._heights
        text = (
            f"none of the {len(z)} points within {raw.range_max:g} m is between {low:g} and {high:g} m high: they are "
            f"{z.min():.2f} to {z.max():.2f} m high if {self.mounted_by} mounts the lidar at {self._matrix[2, 3]:.2f} m"
        )
        return [ScanFault("heights", f"{text}; if that is wrong, {_ASK}", True)]

    def _needs_no_conversion(self, raw: LaserScan) -> bool:
        """Whether the ranges need no conversion: same beams in the same order, and 0 is not a valid range."""
        lidar = self.robot.lidar
        first = math.isclose(raw.angle_min, lidar.angle_min, abs_tol=1e-5)
        upright = raw.angle_increment > 0.0 and not self.upside_down
        return first and upright and len(raw.ranges) == lidar.num_beams and lidar.range_min > 0.0

    def _flattened(self, message: Any) -> LaserScan:
        cloud = self._config.cloud
        low, high = self._heights
        projection = Projection(
            min_height=low,
            max_height=high,
            angle_increment=cloud.angle_increment,
            range_min=self._config.range_min or 0.0,
            range_max=self._config.range_max or cloud.range_max,
        )
        scan = to_scan(cloud_points(message), projection, self._matrix)
        middle = scan.angle_min + scan.angle_increment / 2.0  # of the first bin, which begins at angle_min
        return scan._replace(ranges=np.asarray(scan.ranges, np.float32), angle_min=middle)


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Build the lidar of a message without the warnings for a robot's file: `scan_faults` says what is odd about it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def _mount(config: ScanConfig, by_tf: Floats | None, robot: Robot, height: float) -> tuple[str, Floats]:
    """The source of the lidar's mount, and the mount: (4, 4) from the lidar's frame to the base frame.

    height: of the lidar if neither scan.mount nor tf knows it [m].
    """
    if config.mount is not None:
        return "scan.mount", _matrix(config.mount)
    if by_tf is not None:
        return "tf", by_tf
    pose = robot.lidar.mount
    return f"robot={robot.name}", rigid_transform((pose.x, pose.y, height, 0.0, 0.0, pose.yaw))


def _cloud_mount(config: ScanConfig, by_tf: Floats | None, robot: Robot, frame_id: str) -> tuple[str, Floats]:
    """The same for a cloud, whose heights must be above the floor.

    The robot knows the height of its lidar above the floor, tf only that above the base frame. If tf's is less, the
    base frame is above the floor, e.g. at the lidar, as FAST-LIO has it. Raises InputError if nobody knows the height.
    """
    in_base_frame = config.cloud.min_height is not None and config.cloud.min_height < 0.0
    cloud = None if in_base_frame else robot.lidar.cloud
    source, matrix = _mount(config, by_tf, robot, 0.0 if cloud is None else cloud.height)
    if source == "scan.mount" or in_base_frame:
        return source, matrix
    if robot.lidar.cloud is None:
        if by_tf is None:
            raise InputError(
                f"tf does not connect the cloud's frame {frame_id!r} to the base frame, and robot={robot.name} has no "
                f"lidar.cloud.height: {_ASK}"
            )
        if matrix[2, 3] < _HEIGHTS[0] and frame_id not in _BASES:
            warnings.warn(
                f"tf puts the frame of the cloud, {frame_id}, {matrix[2, 3]:.2f} m above the base frame: if the base "
                f"frame is not on the floor, {_ASK}",
                stacklevel=3,
            )
        return source, matrix
    above_base, height = float(matrix[2, 3]), robot.lidar.cloud.height
    if abs(above_base - height) <= _SAME_HEIGHT or frame_id == _ON_THE_FLOOR:
        return source, matrix
    heights = f"tf puts the lidar {above_base:.2f} m above the base frame, but robot={robot.name} has it "
    heights += f"{height:g} m above the floor (lidar.cloud.height)"
    if above_base > height:
        warnings.warn(f"{heights}: tf is used; if that is wrong, {_ASK}", stacklevel=3)
        return source, matrix
    raised = f"the base frame is taken to be {height - above_base:.2f} m above the floor"
    warnings.warn(f"{heights}: {raised}; if that is wrong, {_ASK}", stacklevel=3)
    lifted = matrix.copy()
    lifted[2, 3] = height
    return source, lifted


def _heights(config: CloudConfig, robot: Robot) -> tuple[float, float]:
    """The lowest and the highest points that count [m]. Raises InputError unless they rise."""
    own = robot.lidar.cloud
    low, high = _HEIGHTS if own is None else (own.min_height, own.max_height)
    low = low if config.min_height is None else config.min_height
    high = high if config.max_height is None else config.max_height
    require("scan.cloud.max_height", high, above=low)
    return low, high


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


def _matrix(mount: Sequence[float]) -> Floats:
    try:
        return rigid_transform(mount)
    except InputError as error:
        raise InputError(f"scan.{error}") from error


def _scan_of_lidar(lidar: Lidar, ranges: Any) -> LaserScan:
    return LaserScan(
        np.ascontiguousarray(ranges, np.float32),
        lidar.angle_min,
        lidar.angle_increment,
        lidar.range_min,
        lidar.range_max,
    )
