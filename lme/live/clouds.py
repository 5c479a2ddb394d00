"""Scans from point clouds: the points between two heights above the floor, as a level robot would see them."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

from lme.errors import InputError, require
from lme.geometry.frames import relative
from lme.live.config import CloudConfig, ScanConfig, mount_of
from lme.live.frames import Carrier
from lme.live.messages import planar_matrix, stamp_of
from lme.live.poses import Posture
from lme.perception.point_cloud import (
    Projection,
    cloud_points,
    point_times,
    rigid_transform,
    to_scan,
    without_unmeasured,
)
from lme.perception.scan_check import FAR, ScanFault
from lme.robots import Robot
from lme.types import Floats, LaserScan, Pose

_HEIGHTS = (0.05, 0.5)  # [m] ASSUMED: above the floor's noise; the robot passes under higher points
_SAME_HEIGHT = 0.1  # [m] difference up to which tf and the robot agree on the height of the lidar
_ON_THE_FLOOR = "base_footprint"  # by REP-120
_BASES = (_ON_THE_FLOOR, "base_link")  # the frames of clouds that are already in the base frame
_SELDOM_S = 0.03  # [s] between two orientations; a walking robot turns by a degree in that time
_ROCKS = math.radians(1.0)  # [rad] by which the tilt of a walking robot changes within half a second
_ASK = "set scan.mount=[x, y, z, roll, pitch, yaw] [m, rad], with z above the floor"


class CloudReader:
    """A reader that turns the clouds of one frame into scans.

    The mount moves a point into the base frame; then roll and pitch of the base, at the time of the point, turn it
    upright about the origin of that frame. A cloud in the odometry frame is moved by the pose instead.

    mounted_by: the source of the mount. carrier: what the frame of the clouds moves with.
    """

    def __init__(
        self, config: ScanConfig, by_tf: Floats | None, robot: Robot, frame_id: str, carrier: Carrier
    ) -> None:
        """Find the mount of the clouds, and the heights that count.

        by_tf: (4, 4) from the frame of the clouds, frame_id, to the base frame; None if tf does not know it.
        Raises InputError if the height of the clouds above the floor is not known.
        """
        cloud, lidar = config.cloud, robot.lidar
        self.carrier, self._levels = carrier, cloud.level and carrier is Carrier.BASE
        self.mounted_by, self._mount, self._base_height = _place(config, by_tf, robot, frame_id, carrier)
        # A cloud in the odometry frame does not tell where its lidar is: above the base.
        height = self._base_height if lidar.cloud is None else lidar.cloud.height
        at_base = np.array((0.0, 0.0, height))
        self._sensor = at_base if carrier is Carrier.ODOMETRY else np.ascontiguousarray(self._mount[:3, 3])
        self._heights, self._outline = _heights(cloud, robot), robot.footprint.circumscribed_radius
        farthest = cloud.range_max if config.range_max is None else config.range_max
        self._projection = Projection(
            *self._heights,
            angle_increment=lidar.angle_increment if cloud.angle_increment is None else cloud.angle_increment,
            range_min=lidar.range_min if config.range_min is None else config.range_min,
            range_max=lidar.range_max if farthest is None else farthest,
        )

    def scan(self, message: Any, posture: Posture | None) -> LaserScan:
        """Return the scan of a cloud, in the base frame.

        posture: posture of the base at the cloud's stamp; None if not known.
        """
        points, upright = self._upright(message, posture)
        scan = to_scan(points, self._projection, upright)
        level_points = points @ upright[:3, :3].T + upright[:3, 3]
        scan = without_unmeasured(scan, level_points, self._sensor, self._projection)
        middle = scan.angle_min + scan.angle_increment / 2.0  # of the first bin, which begins at angle_min
        return scan._replace(ranges=np.asarray(scan.ranges, np.float32), angle_min=middle)

    def faults(self, message: Any, raw: LaserScan, posture: Posture | None) -> list[ScanFault]:
        """Faults of a cloud whose scan is `raw`."""
        faults = self._tilt_faults(message, posture) if self._levels and posture is not None else []
        return faults if np.isfinite(raw.ranges).any() else faults + self._height_faults(message, posture)

    def _upright(self, message: Any, posture: Posture | None) -> tuple[Floats, Floats]:
        """The points (N, 3), and the transform (4, 4) to the base frame of a level robot, with z above the floor."""
        points = cloud_points(message)
        # A cloud in the odometry frame is level: Rz(−yaw) (p − beneath) moves it to the floor below the base.
        if posture is not None and self.carrier is Carrier.ODOMETRY:
            x, y, yaw = posture.pose
            beneath = (x, y, posture.height - self._base_height)
            upright = rigid_transform((0.0, 0.0, 0.0, 0.0, 0.0, -yaw))
            upright[:3, 3] = -upright[:3, :3] @ beneath
            return points, upright
        if posture is None or not self._levels or not len(posture.tilts):
            return points, self._mount
        # Otherwise turn the points upright about the origin o of the base frame, R (p − o) + o: each by the tilt at
        # its own time, or all by that at the stamp if they have no times.
        times = point_times(message, stamp_of(message.header))
        tilt_times, rolls, pitches = posture.tilts.T
        roll, pitch = (
            np.interp(0.0 if times is None else times, tilt_times, angles) for angles in (rolls, pitches)
        )
        origin = np.array((0.0, 0.0, self._base_height))
        if times is None:
            turn = rigid_transform((0.0, 0.0, 0.0, float(roll), float(pitch), 0.0))
            turn[:3, 3] = origin - turn[:3, :3] @ origin
            return points, turn @ self._mount
        on_base = points @ self._mount[:3, :3].T + self._mount[:3, 3] - origin
        return _turned(on_base, roll, pitch) + origin, np.eye(4)

    def _tilt_faults(self, message: Any, posture: Posture) -> list[ScanFault]:
        """Faults of a cloud that cannot be levelled, or not well."""
        if posture.problem:
            text = (
                f"a cloud is read as if the robot never tilted: {posture.problem}; choose an IMU that measures its "
                "orientation with topics.imu, or set scan.cloud.level=false for a robot that stays level"
            )
            return [ScanFault("tilt", text, False)]
        # Orientations that come seldom only matter if the robot rocks while the points are measured.
        tilts = posture.tilts
        if (
            len(tilts) < 2
            or np.median(np.diff(tilts[:, 0])) < _SELDOM_S
            or np.ptp(tilts[:, 1:], 0).max() < _ROCKS
        ):
            return []
        times = point_times(message, stamp_of(message.header))
        if times is None or np.ptp(times) < _SELDOM_S:
            return []
        text = (
            f"the points of a cloud are measured over {np.ptp(times):.2f} s, but roll and pitch come only every "
            f"{np.median(np.diff(tilts[:, 0])):.2f} s, too seldom for a robot that rocks: choose a cloud without this "
            "distortion, such as FAST-LIO's cloud_registered_body, or faster odometry"
        )
        return [ScanFault("seldom", text, False)]

    def _height_faults(self, message: Any, posture: Posture | None) -> list[ScanFault]:
        """Faults of a cloud that has points, but none that counts: they would be taken for free space."""
        points, upright = self._upright(message, posture)
        points = points[np.isfinite(points).all(axis=1) & points.any(axis=1)]
        x, y, z = (points @ upright[:3, :3].T + upright[:3, 3]).T
        distance, projection = np.hypot(x, y), self._projection
        in_range = (distance >= projection.range_min) & (distance <= projection.range_max)
        z = z[(distance > self._outline) & in_range]
        # Without points in range, either the cloud shows free space or its unit is wrong.
        if not len(z):
            if not len(distance) or np.median(distance) < FAR:
                return []
            text = f"the {len(points)} points of a cloud are {np.median(distance):.4g} m away in the median"
            return [ScanFault("unit", f"{text}: must be in metres; these look like millimetres", True)]
        low, high = self._heights
        text = (
            f"none of the {len(z)} points within {projection.range_max:g} m is between {low:g} and {high:g} m high: "
            f"they are {z.min():.2f} to {z.max():.2f} m high if {self.mounted_by} mounts the lidar at "
            f"{self._mount[2, 3]:.2f} m"
        )
        return [ScanFault("heights", f"{text}; if that is wrong, {_ASK}", True)]


def _turned(points: Floats, roll: Floats, pitch: Floats) -> Floats:
    """Points (N, 3), each turned by its roll (N,) about x and then by its pitch (N,) about y [rad]."""
    x, y, z = points.T
    y, z = np.cos(roll) * y - np.sin(roll) * z, np.sin(roll) * y + np.cos(roll) * z
    x, z = np.cos(pitch) * x + np.sin(pitch) * z, np.cos(pitch) * z - np.sin(pitch) * x
    return np.column_stack((x, y, z))


def _place(
    config: ScanConfig, by_tf: Floats | None, robot: Robot, frame_id: str, carrier: Carrier
) -> tuple[str, Floats, float]:
    """The source of the mount, the mount with z above the floor, and the height of the base frame above the floor.

    The mount is (4, 4), from the lidar's frame to the base frame. Raises InputError for a cloud in a frame above the
    odometry frame, or if its height is not known.
    """
    in_base_frame = config.cloud.min_height is not None and config.cloud.min_height < 0.0
    if carrier is Carrier.MAP:
        raise InputError(
            f"the cloud is in {frame_id}, a frame above the odometry frame: choose one in the odometry frame, or in a "
            "frame of the robot"
        )
    if carrier is Carrier.ODOMETRY:
        height = 0.0 if in_base_frame else _base_height(config, robot, frame_id)
        return "the pose", rigid_transform((0.0, 0.0, height, 0.0, 0.0, 0.0)), height
    # A level frame does not share the tilt of the base: keep x, y, yaw and the height of its transform only.
    if carrier is Carrier.LEVEL and by_tf is not None:
        flat = relative(Pose(0.0, 0.0, 0.0), planar_matrix(np.asarray(np.linalg.inv(by_tf)))[0])
        height = 0.0 if frame_id == _ON_THE_FLOOR else float(by_tf[2, 3])
        by_tf = rigid_transform((flat.x, flat.y, height, 0.0, 0.0, flat.yaw))
    source, mount = _cloud_mount(config, by_tf, robot, frame_id, in_base_frame)
    # Without tf the base counts as being at the lidar, where FAST-LIO has it.
    above_base = 0.0 if by_tf is None else float(by_tf[2, 3])
    return source, mount, 0.0 if in_base_frame else float(mount[2, 3]) - above_base


def _base_height(config: ScanConfig, robot: Robot, frame_id: str) -> float:
    """Height of the base frame above the floor, for clouds in the odometry frame [m].

    Warns if it is that of the robot's lidar. Raises InputError if nothing gives it.
    """
    if config.mount is not None:
        return config.mount[2]
    if robot.lidar.cloud is None:
        raise InputError(
            f"the cloud is in the odometry frame, {frame_id}, and robot={robot.name} has no lidar.cloud.height: "
            "set scan.mount=[0, 0, HEIGHT, 0, 0, 0] to the height of the base frame above the floor [m]"
        )
    height = robot.lidar.cloud.height
    warnings.warn(
        f"the cloud is in the odometry frame, {frame_id}: the base frame is taken to be at the lidar of "
        f"robot={robot.name}, {height:g} m above the floor (lidar.cloud.height); if that is wrong, set "
        "scan.mount=[0, 0, HEIGHT, 0, 0, 0] to its height [m]",
        stacklevel=5,
    )
    return height


def _cloud_mount(
    config: ScanConfig, by_tf: Floats | None, robot: Robot, frame_id: str, in_base_frame: bool
) -> tuple[str, Floats]:
    """The source of the mount and the mount of a cloud, whose heights must be above the floor.

    The robot knows the height of its lidar above the floor, tf only that above the base frame. If tf's is less, the
    base frame is above the floor, e.g. at the lidar, as FAST-LIO has it. Raises InputError if neither knows it.
    """
    cloud = None if in_base_frame else robot.lidar.cloud
    source, matrix = mount_of(config, by_tf, robot, 0.0 if cloud is None else cloud.height)
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
                stacklevel=5,
            )
        return source, matrix
    # Compare the heights by tf and by the robot: where they differ, the greater one is taken to be above the floor.
    above_base, height = float(matrix[2, 3]), robot.lidar.cloud.height
    if abs(above_base - height) <= _SAME_HEIGHT or frame_id == _ON_THE_FLOOR:
        return source, matrix
    heights = f"tf puts the lidar {above_base:.2f} m above the base frame, but robot={robot.name} has it "
    heights += f"{height:g} m above the floor (lidar.cloud.height)"
    if above_base > height:
        warnings.warn(f"{heights}: tf is used; if that is wrong, {_ASK}", stacklevel=5)
        return source, matrix
    raised = f"the base frame is taken to be {height - above_base:.2f} m above the floor"
    warnings.warn(f"{heights}: {raised}; if that is wrong, {_ASK}", stacklevel=5)
    lifted = matrix.copy()
    lifted[2, 3] = height
    return source, lifted


def _heights(config: CloudConfig, robot: Robot) -> tuple[float, float]:
    """Heights of the lowest and the highest points that count [m]. Raises InputError unless they rise."""
    cloud = robot.lidar.cloud
    low, high = _HEIGHTS if cloud is None else (cloud.min_height, cloud.max_height)
    low = low if config.min_height is None else config.min_height
    high = high if config.max_height is None else config.max_height
    require("cloud.max_height", high, above=low)
    return low, high
