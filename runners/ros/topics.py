"""Names and types of the topics."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass

from lme.errors import InputError
from lme.live.poses import TWISTS

TF_MESSAGE = "tf2_msgs/TFMessage"
TF = "tf"  # takes the place of a topic of poses
CLOUD = "PointCloud2"
SCANS = {"LaserScan": "sensor_msgs", CLOUD: "sensor_msgs"}
POSES = {
    "Odometry": "nav_msgs",
    "PoseStamped": "geometry_msgs",
    "PoseWithCovarianceStamped": "geometry_msgs",
    "TransformStamped": "geometry_msgs",
}
COMMANDS = {"Twist": "geometry_msgs", "TwistStamped": "geometry_msgs"}
IMU_KIND = "sensor_msgs/Imu"
_GOAL = {1: "move_base_simple/goal", 2: "goal_pose"}  # where RViz sends a goal
_NAME = re.compile(r"(~/|/)?[a-z_]\w*(/[a-z_]\w*)*", re.ASCII | re.IGNORECASE)
_ACTION = {1: "move_base", 2: "navigate_to_pose"}


@dataclass(slots=True)
class LiveTopicsConfig:
    """Names and types of the topics. goal, action: null for the usual name in this version of ROS.

    imu: null for none. twist: where velocities come from, the messages or the poses.
    """

    scan: str = "scan"
    scan_type: str = "LaserScan"
    pose: str = "odom"
    pose_type: str = "Odometry"
    twist: str = "measured"
    imu: str | None = None
    command: str = "cmd_vel"
    command_type: str = "Twist"
    goal: str | None = None
    action: str | None = None
    cancel: str = "lme/cancel"
    tf: str = "/tf"
    tf_static: str = "/tf_static"
    clock: str = "/clock"
    subgoal: str = "lme/subgoal"
    markers: str = "lme/markers"
    reason: str = "lme/reason"
    diagnostics: str = "/diagnostics"

    def __post_init__(self) -> None:
        choices = {"scan_type": SCANS, "pose_type": POSES, "command_type": COMMANDS, "twist": TWISTS}
        for key, types in choices.items():
            if getattr(self, key) not in types:
                raise InputError(f"topics.{key} is {getattr(self, key)}: must be one of {', '.join(types)}")
        for key, name in asdict(self).items():
            if name is not None and not _NAME.fullmatch(name):
                raise InputError(f"topics.{key} is {name!r}: must be letters, digits and _, as in front/scan")

    def goal_in(self, version: int) -> str:
        """Return the topic of goals in a version of ROS."""
        return self.goal or _GOAL[version]

    def action_in(self, version: int) -> str:
        """Return the navigation action in a version of ROS."""
        return self.action or _ACTION[version]

    @property
    def scan_kind(self) -> str:
        """Type of the scans with its package."""
        return f"{SCANS[self.scan_type]}/{self.scan_type}"

    @property
    def pose_kind(self) -> str:
        """Type of the poses with its package."""
        return f"{POSES[self.pose_type]}/{self.pose_type}"

    @property
    def command_kind(self) -> str:
        """Type of the commands with its package."""
        return f"{COMMANDS[self.command_type]}/{self.command_type}"
