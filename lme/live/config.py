"""Settings of the live driver and of the scans that it reads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from lme.errors import InputError, argument_error, config_key, require
from lme.inputs import plausibility
from lme.perception.point_cloud import rigid_transform
from lme.robots import Robot
from lme.types import Floats

CLOCKS = ("header", "received")
LIDARS = ("recorded", "robot")


@dataclass(slots=True)
class LiveConfig:
    """Conditions in which the robot must stand, and in which it has arrived."""

    stale: float = 0.5  # [s] older scans, poses and transforms stop the robot
    time_jump: float = 1.0  # [s] ASSUMED: a clock that advances by more between two calls has jumped
    goal_tolerance: float = 0.2  # [m] ASSUMED: as for map=env1
    soft_stop: bool = True  # stop if the robot would touch what the lidar sees before it could stand
    clock: str = "header"  # header: the messages' stamps | received: the times at which they arrive
    seed: int = 0  # of the guide's and planner's random numbers

    def __post_init__(self) -> None:
        for key in ("stale", "time_jump", "goal_tolerance"):
            require(key, getattr(self, key), above=0.0)
            plausibility.check(config_key(key), getattr(self, key))
        require("seed", self.seed, at_least=0)
        if self.clock not in CLOCKS:
            raise argument_error(f"clock is {self.clock!r}: must be one of {', '.join(CLOCKS)}")


@dataclass(slots=True)
class CloudConfig:
    """Settings for making a scan of a point cloud.

    Heights are above the floor; None: those of robot.lidar.cloud, else 0.05 and 0.5 m. With a negative min_height,
    which only a base frame above the floor can need, they are in the base frame. Angle and range: None for those of
    the robot's lidar. level: take roll and pitch of the base out of a cloud that tilts with it.
    """

    min_height: float | None = None  # [m]
    max_height: float | None = None  # [m]
    angle_increment: float | None = None  # [rad]
    range_max: float | None = None  # [m]
    level: bool = True


@dataclass(slots=True)
class ScanConfig:
    """Settings for reading scans. mount: [x, y, z [m], roll, pitch, yaw [rad]] of the lidar on the base."""

    lidar: str = "recorded"
    mount: list[float] | None = None
    range_min: float | None = None  # [m]
    range_max: float | None = None  # [m]
    cloud: CloudConfig = field(default_factory=CloudConfig)

    def __post_init__(self) -> None:
        if self.lidar not in LIDARS:
            raise argument_error(f"lidar is {self.lidar!r}: must be one of {', '.join(LIDARS)}")
        if self.mount is not None:
            _matrix(self.mount)
            for key, angle in zip(("roll", "pitch", "yaw"), self.mount[3:], strict=True):
                plausibility.check(config_key(f"mount.{key}"), angle)
        if self.range_min is not None:
            require("range_min", self.range_min, at_least=0.0)
            plausibility.check(config_key("range_min"), self.range_min)
        if self.range_max is not None:
            require("range_max", self.range_max, above=self.range_min or 0.0)
            plausibility.check(config_key("range_max"), self.range_max)
        cloud = self.cloud
        if cloud.min_height is not None:
            require("min_height", cloud.min_height)
        if cloud.max_height is not None:
            require("max_height", cloud.max_height, above=cloud.min_height)
        if cloud.angle_increment is not None:
            require("angle_increment", cloud.angle_increment, above=0.0, at_most=0.5)
            plausibility.check(config_key("cloud.angle_increment"), cloud.angle_increment)
        if cloud.range_max is not None:
            require("range_max", cloud.range_max, above=0.0)


def mount_of(config: ScanConfig, by_tf: Floats | None, robot: Robot, height: float) -> tuple[str, Floats]:
    """The source of the lidar's mount, and the mount: (4, 4) from the lidar's frame to the base frame.

    height: height of the lidar if neither scan.mount nor tf gives it [m].
    """
    if config.mount is not None:
        x, y = config.mount[:2]
        plausibility.check_mount("scan.mount", x, y, robot.footprint.circumscribed_radius)
        return "scan.mount", _matrix(config.mount)
    if by_tf is not None:
        return "tf", by_tf
    pose = robot.lidar.sensor
    return f"robot={robot.name}", rigid_transform((pose.x, pose.y, height, 0.0, 0.0, pose.yaw))


def _matrix(mount: Sequence[float]) -> Floats:
    try:
        return rigid_transform(mount)
    except InputError as error:
        raise argument_error(f"{error}") from error
