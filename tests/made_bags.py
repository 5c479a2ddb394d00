"""Recordings made for tests: the same drive in any format, over any topics."""

import math
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lme.geometry.frames import compose
from lme.live.messages import Tilt
from lme.perception.point_cloud import rigid_transform
from lme.perception.raycast import cast_shapes
from lme.types import Pose

SECOND = 1_000_000_000
TF = "tf2_msgs/msg/TFMessage"
BEGAN = 1_700_000_000 * SECOND
CIRCLES = np.array([[2.0, 1.5, 0.3], [3.0, -1.0, 0.4], [5.0, 0.6, 0.3], [-1.5, 0.5, 0.2]])
EDGES = np.array(
    [[-3.0, -3.0, 8.0, -3.0], [-3.0, 3.0, 8.0, 3.0], [8.0, -3.0, 8.0, 3.0], [-3.0, -3.0, -3.0, 3.0]]
)


MOUNT = Pose(0.1, 0.0, 0.0)
MOUNT_HEIGHT = 0.2  # [m]
LEVEL = Tilt(0.0, 0.0)

# The same drive of other robots: arguments of `drive`.
OTHERS = {
    "clockwise": {"clockwise": True},
    "upside down": {"roll": math.pi, "clockwise": True},
    "from straight ahead": {"first": 0.0},
    "rotated and off-centre": {"mount": Pose(-0.15, 0.1, 2.0)},
    "rotated and clockwise": {"mount": Pose(0.05, -0.1, -2.5), "clockwise": True},
    "first beam repeated": {"beams": 539, "repeated": True},
    "beams without a value": {"spoil": lambda ranges: spoilt(ranges)},
    "lidar on a plate": {"plate": Pose(0.2, -0.1, 0.7)},
    "poses by tf": {"poses": "tf"},
    "motion capture": {"poses": "motion capture"},
    "motion capture with covariance": {"poses": "covariance"},
    "motion capture as transforms": {"poses": "transform"},
}


class BagMaker:
    """Collects messages and writes them as `.bag`, `.db3` or `.mcap`."""

    def __init__(self, suffix=".mcap"):
        self.suffix = suffix
        self.store = get_typestore(Stores.ROS1_NOETIC if suffix == ".bag" else Stores.ROS2_HUMBLE)
        if suffix == ".bag":
            tf = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(tf, "tf2_msgs/msg/TFMessage"))
        self.messages = []

    def make(self, kind, *fields):
        return self.store.types[kind](*fields)

    def header(self, stamp, frame):
        time = self.make("builtin_interfaces/msg/Time", *divmod(stamp, SECOND))
        sequence = (0,) if self.suffix == ".bag" else ()
        return self.make("std_msgs/msg/Header", *sequence, time, frame)

    def add(self, topic, kind, recorded, message):
        self.messages.append((recorded, topic, kind, message))

    def write(self, folder, name="drive"):
        """The path of the file."""
        messages = sorted(self.messages, key=lambda one: one[0])
        if self.suffix == ".bag":
            path = Path(folder) / f"{name}.bag"
            with Writer1(path) as writer:
                self.fill(writer, messages, self.store.serialize_ros1)
            return path
        storage = StoragePlugin.MCAP if self.suffix == ".mcap" else StoragePlugin.SQLITE3
        with Writer2(Path(folder) / name, version=8, storage_plugin=storage) as writer:
            self.fill(writer, messages, self.store.serialize_cdr)
        return next((Path(folder) / name).glob(f"*{self.suffix}"))

    def fill(self, writer, messages, serialize):
        connections = {}
        for recorded, topic, kind, message in messages:
            if (topic, kind) not in connections:
                connections[topic, kind] = writer.add_connection(topic, kind, typestore=self.store)
            writer.write(connections[topic, kind], recorded, serialize(message, kind))

    # Messages

    def quaternion(self, yaw, roll=0.0, pitch=0.0):
        (cy, sy), (cr, sr), (cp, sp) = (
            (math.cos(angle / 2), math.sin(angle / 2)) for angle in (yaw, roll, pitch)
        )
        return self.make(
            "geometry_msgs/msg/Quaternion",
            cy * sr * cp - sy * cr * sp,
            sy * sr * cp + cy * cr * sp,
            sy * cr * cp - cy * sr * sp,
            cy * cr * cp + sy * sr * sp,
        )

    def pose(self, pose, height=0.0, tilt=LEVEL):
        point = self.make("geometry_msgs/msg/Point", pose.x, pose.y, height)
        return self.make("geometry_msgs/msg/Pose", point, self.quaternion(pose.yaw, *tilt))

    def twist(self, v, omega):
        linear = self.make("geometry_msgs/msg/Vector3", v, 0.0, 0.0)
        return self.make(
            "geometry_msgs/msg/Twist", linear, self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, omega)
        )

    def odometry(self, stamp, pose, v, omega, height=0.0, tilt=LEVEL):
        none = np.zeros(36)
        return self.make(
            "nav_msgs/msg/Odometry", self.header(stamp, "odom"), "base_link",
            self.make("geometry_msgs/msg/PoseWithCovariance", self.pose(pose, height, tilt), none),
            self.make("geometry_msgs/msg/TwistWithCovariance", self.twist(v, omega), none),
        )  # fmt: skip

    def imu(self, stamp, yaw=0.0, tilt=LEVEL, frame="base_link"):
        unknown, vector = np.zeros(9), self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, 9.81)
        return self.make(
            "sensor_msgs/msg/Imu", self.header(stamp, frame), self.quaternion(yaw, *tilt), unknown, vector, unknown,
            vector, unknown,
        )  # fmt: skip

    def pose_with_covariance(self, stamp, frame, pose):
        known = self.make("geometry_msgs/msg/PoseWithCovariance", self.pose(pose), np.zeros(36))
        return self.make("geometry_msgs/msg/PoseWithCovarianceStamped", self.header(stamp, frame), known)

    def pose_stamped(self, stamp, frame, pose):
        return self.make("geometry_msgs/msg/PoseStamped", self.header(stamp, frame), self.pose(pose))

    def transform(self, stamp, frame, child, pose, roll=0.0):
        shift = self.make("geometry_msgs/msg/Vector3", pose.x, pose.y, MOUNT_HEIGHT)
        moved = self.make("geometry_msgs/msg/Transform", shift, self.quaternion(pose.yaw, roll))
        return self.make("tf2_msgs/msg/TFMessage", [
            self.make("geometry_msgs/msg/TransformStamped", self.header(stamp, frame), child, moved)
        ])  # fmt: skip

    def scan(self, stamp, ranges, angle_min, increment, limits=(0.05, 12.0)):
        end = angle_min + (len(ranges) - 1) * increment
        return self.make(
            "sensor_msgs/msg/LaserScan", self.header(stamp, "laser"), angle_min, end, increment, 0.0, 0.1,
            *limits, np.ascontiguousarray(ranges, np.float32), np.empty(0, np.float32),
        )  # fmt: skip

    def cloud(self, stamp, points, frame="laser", times=None):
        """times: of the points [ns], in a field as that of livox_ros_driver2."""
        fields = [self.make("sensor_msgs/msg/PointField", n, 4 * k, 7, 1) for k, n in enumerate("xyz")]
        rows = np.ascontiguousarray(points, np.float32).view(np.uint8)
        if times is not None:
            fields.append(self.make("sensor_msgs/msg/PointField", "timestamp", 12, 8, 1))
            rows = np.hstack((rows, np.array(times, np.float64)[:, None].view(np.uint8)))
        step = rows.shape[1] if len(points) else 12
        return self.make(
            "sensor_msgs/msg/PointCloud2", self.header(stamp, frame), 1, len(points), fields, False, step,
            step * len(points), rows.reshape(-1), True,
        )  # fmt: skip


def way(steps):
    """(pose, v, ω) of a drive among the obstacles, ten per second."""
    pose, v, found = Pose(0.0, 0.0, 0.1), 0.25, []
    for k in range(steps):
        omega = 0.3 * math.sin(0.15 * k)
        found.append((pose, v, omega))
        pose = compose(pose, Pose(v * 0.1, 0.0, omega * 0.1))
    return found


def seen(pose, mount=MOUNT, beams=360, first=-math.pi):
    """Ranges of a full circle from the bearing `first` on, counter-clockwise."""
    return cast_shapes(compose(pose, mount), (first, 2 * math.pi / beams, beams), 12.0, CIRCLES, EDGES)


def spoilt(ranges):
    """The ranges with beams that return nothing, as drivers report them."""
    ranges = ranges.copy()
    for k, value in enumerate((0.0, math.nan, math.inf, -1.0)):
        ranges[k::29] = value
    return ranges


def drive(
    suffix=".mcap",
    steps=60,
    poses="odometry",
    mount=MOUNT,
    roll=0.0,
    clockwise=False,
    scans="laser",
    stamps=lambda stamp: stamp,
    commands=True,
    beams=360,
    first=-math.pi,
    repeated=False,
    spoil=lambda ranges: ranges,
    plate=None,
    tilt=lambda k: LEVEL,
    tilted=("poses",),
):
    """A BagMaker with one drive.

    stamps: what the headers say, by when a message was recorded. repeated: the first beam comes again as the last.
    spoil: what becomes of the ranges. plate: pose on the base of a plate that carries the lidar. tilt: of the base at
    every step, where clouds are seen from. tilted: what says so, poses or imu.
    """
    made = BagMaker(suffix)
    carrier = "base_link" if plate is None else "plate"
    if plate is not None:
        made.add("/tf_static", TF, BEGAN, made.transform(0, "base_link", "plate", plate))
    made.add("/tf_static", TF, BEGAN, made.transform(0, carrier, "laser", mount, roll))
    if plate is not None:
        mount = compose(plate, mount)
    for k, (pose, v, omega) in enumerate(way(steps)):
        recorded = BEGAN + k * SECOND // 10
        stamp = stamps(recorded)
        if poses == "odometry":
            known = tilt(k) if "poses" in tilted else LEVEL
            message = made.odometry(stamp, pose, v, omega, tilt=known)
            made.add("/odom", "nav_msgs/msg/Odometry", recorded, message)
        elif poses == "tf":
            made.add("/tf", TF, recorded, made.transform(stamp, "odom", "base_link", pose))
        elif poses == "motion capture":
            message = made.pose_stamped(stamp, "world", pose)
            made.add("/vrpn/robot/pose", "geometry_msgs/msg/PoseStamped", recorded, message)
        elif poses == "covariance":
            message = made.pose_with_covariance(stamp, "world", pose)
            made.add("/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", recorded, message)
        elif poses == "transform":
            message = made.transform(stamp, "world", "robot", pose).transforms[0]
            made.add("/vicon/robot", "geometry_msgs/msg/TransformStamped", recorded, message)
        ranges = spoil(seen(pose, mount, beams, first))
        if repeated:
            ranges = np.append(ranges, ranges[0])
        if "imu" in tilted:
            made.add("/imu", "sensor_msgs/msg/Imu", recorded, made.imu(stamp, pose.yaw, tilt(k)))
        angles = first, 2 * math.pi / beams, clockwise
        _add_scan(made, scans, recorded, stamp, ranges, angles, seen_tilted(mount, tilt(k)))
        if commands:
            made.add("/cmd_vel", "geometry_msgs/msg/Twist", recorded, made.twist(v, omega))
    return made


def seen_tilted(mount, tilt):
    """(4, 4) from where a level lidar sees a point to where it sees it on a tilted base, on the floor."""
    lidar = rigid_transform((mount.x, mount.y, MOUNT_HEIGHT, 0.0, 0.0, mount.yaw))
    return np.linalg.inv(rigid_transform((0.0, 0.0, 0.0, *tilt, 0.0)) @ lidar) @ lidar


def _add_scan(made, scans, recorded, stamp, ranges, angles, tilted):
    first, increment, clockwise = angles
    if scans == "laser":
        if clockwise:
            first += (len(ranges) - 1) * increment
            ranges, increment = ranges[::-1], -increment
        made.add("/scan", "sensor_msgs/msg/LaserScan", recorded, made.scan(stamp, ranges, first, increment))
    elif scans == "cloud":
        angles = first + np.arange(len(ranges)) * increment
        flat = np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles), np.zeros(len(ranges))))
        rings = [
            np.column_stack(
                (reach * np.cos(angles), reach * np.sin(angles), np.full(len(ranges), -MOUNT_HEIGHT))
            )
            for reach in (0.5, np.minimum(0.9 * ranges, 2.5))
        ]
        points = np.vstack((flat, *rings)) @ tilted[:3, :3].T + tilted[:3, 3]
        made.add("/points", "sensor_msgs/msg/PointCloud2", recorded, made.cloud(stamp, points))
