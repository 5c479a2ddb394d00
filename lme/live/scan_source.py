"""Converts scans and point clouds of any lidar to scans of the robot's lidar."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lme import plausibility
from lme.errors import InputError, require
from lme.live.messages import is_cloud, planar_matrix, scan_of
from lme.live.track import StampedMotion
from lme.robots import Lidar, Robot
from lme.sensing.point_cloud import cloud_points, rigid_transform
from lme.sensing.projection import Projection, to_scan
from lme.sensing.resampling import own_lidar, resampled, same_lidar, tidied
from lme.types import Floats, LaserScan, Observation, Pose

LIDARS = ("recorded", "robot")
_FINER = 2.5  # times as many beams per angle as in the first message are a finer lidar


@dataclass(slots=True)
class CloudConfig:
    """How a point cloud becomes a scan. Heights are in the base frame."""

    min_height: float = 0.05  # [m]
    max_height: float = 0.5  # [m]
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
        require("scan.cloud.max_height", self.cloud.max_height, above=self.cloud.min_height)
        require("scan.cloud.angle_increment", self.cloud.angle_increment, above=0.0, at_most=0.5)
        require("scan.cloud.range_max", self.cloud.range_max, above=0.0)


class ScanSource:
    """Turns messages into scans of the lidar of `robot`.

    first: the first message. mount: (4, 4) from its frame to the base frame, by tf; None if tf has none.
    With lidar "recorded", the robot gets the lidar of the first message; with "robot", it keeps its own, and scans
    are resampled. Ranges of a scan with exactly the geometry of the lidar stay the same to the last bit.
    """

    def __init__(self, config: ScanConfig, first: Any, mount: Floats | None, robot: Robot) -> None:
        """Raises InputError if the first message is not valid."""
        self._config = config
        self._cloud = is_cloud(first)
        self._spare_range = robot.lidar.range_max
        self.mounted_by, matrix = _mount(config, mount, robot)
        self._matrix = matrix
        self._pose, self.upside_down = (Pose(0.0, 0.0, 0.0), False) if self._cloud else planar_matrix(matrix)
        raw = self.raw(first)
        seen, _ = own_lidar(tidied(raw, self.upside_down), self._pose)
        if config.lidar == "recorded" and not same_lidar(seen, robot.lidar):
            robot = replace(robot, lidar=replace(seen, noise_std=robot.lidar.noise_std))
        self.robot = robot
        self._geometry: tuple[float, ...] = ()
        self._own = self._untouched = False

    @property
    def mount(self) -> Pose:
        """The pose, in the base frame, of the frame of `raw` scans; of a point cloud's, the base itself."""
        return self._pose

    def read(self, message: Any) -> LaserScan:
        """The scan of a LaserScan or PointCloud2 message, as a scan of the robot's lidar."""
        raw, lidar = self.raw(message), self.robot.lidar
        geometry = (len(raw.ranges), *raw[1:])
        if geometry != self._geometry:
            self._geometry = geometry
            self._own = same_lidar(own_lidar(tidied(raw, self.upside_down), self._pose)[0], lidar)
            self._untouched = self._own and self._needs_no_conversion(raw)
        if self._untouched:
            return _scan_of_lidar(lidar, raw.ranges)
        scan = tidied(raw, self.upside_down)
        return _scan_of_lidar(lidar, scan.ranges) if self._own else resampled(scan, self._pose, lidar)

    def observation(self, message: Any, motion: StampedMotion, target: Floats) -> Observation:
        """The input of guide and planner: the scan of a message, and pose, twist and target (2,) [m] at its stamp."""
        return Observation(self.read(message), target, motion.twist, self.robot.limits, motion.pose)

    def exceeded_by(self, message: Any) -> bool:
        """Whether a message shows a wider or much finer lidar than the first, which then was not a whole scan."""
        if self._cloud or self._config.lidar == "robot":
            return False
        lidar, increment = self.robot.lidar, abs(float(message.angle_increment))
        fov = min(len(message.ranges) * increment, math.tau)
        wider = fov > lidar.fov + 2.0 * lidar.angle_increment
        return wider or (fov >= lidar.fov and _FINER * increment < lidar.angle_increment)

    def raw(self, message: Any) -> LaserScan:
        """The scan of a message in its own geometry, with valid range limits."""
        if self._cloud:
            return self._flattened(message)
        scan, config = scan_of(message), self._config
        low = scan.range_min if config.range_min is None else config.range_min
        high = scan.range_max if config.range_max is None else config.range_max
        low = max(low, 0.0) if math.isfinite(low) else 0.0
        return scan._replace(range_min=low, range_max=high if low < high < math.inf else self._spare_range)

    def _needs_no_conversion(self, raw: LaserScan) -> bool:
        """Whether the ranges need no conversion: same beams in the same order, and 0 is not a valid range."""
        lidar = self.robot.lidar
        first = math.isclose(raw.angle_min, lidar.angle_min, abs_tol=1e-5)
        upright = raw.angle_increment > 0.0 and not self.upside_down
        return first and upright and len(raw.ranges) == lidar.num_beams and lidar.range_min > 0.0

    def _flattened(self, message: Any) -> LaserScan:
        cloud = self._config.cloud
        projection = Projection(
            min_height=cloud.min_height,
            max_height=cloud.max_height,
            angle_increment=cloud.angle_increment,
            range_min=self._config.range_min or 0.0,
            range_max=self._config.range_max or cloud.range_max,
        )
        scan = to_scan(cloud_points(message), projection, self._matrix)
        middle = scan.angle_min + scan.angle_increment / 2.0  # of the first bin, which begins at angle_min
        return scan._replace(ranges=np.asarray(scan.ranges, np.float32), angle_min=middle)


def _mount(config: ScanConfig, by_tf: Floats | None, robot: Robot) -> tuple[str, Floats]:
    """The source of the lidar's mount, and the mount: (4, 4) from the lidar's frame to the base frame."""
    if config.mount is not None:
        return "scan.mount", _matrix(config.mount)
    if by_tf is not None:
        return "tf", by_tf
    pose = robot.lidar.mount
    return f"robot={robot.name}", rigid_transform((pose.x, pose.y, 0.0, 0.0, 0.0, pose.yaw))


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
