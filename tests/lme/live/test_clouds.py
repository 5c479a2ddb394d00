"""Clouds of a robot that walks: levelled once, at the time of each point, and projected as by the robot's own lidar."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.errors import InputError
from lme.live.config import CloudConfig, ScanConfig
from lme.live.frames import Carrier
from lme.live.messages import SECOND
from lme.live.poses import Posture
from lme.live.scan_source import ScanSource
from lme.perception.point_cloud import rigid_transform
from lme.types import Pose
from tests import builders
from tests.made_bags import BagMaker
from tests.tolerances import CLOUD_RANGE

GO2 = replace(builders.shipped("go2"), collision_radius=None)
TURTLEBOT = builders.shipped("turtlebot2")
MOUNT = rigid_transform(
    (0.25, 0.0, 0.15, 0.0, 0.1, 0.3)
)  # of the lidar on the base, which is 0.3 m above the floor
BASE_HEIGHT, LIDAR_HEIGHT = 0.3, 0.45
STAMP = 1_700_000_000 * SECOND
HERE = Pose(0.0, 0.0, 0.0)


def room():
    """Points (N, 3) of a floor up to 8 m around a level robot, and of a wall 3 m ahead, from the floor beneath it."""
    bearings, reaches = np.meshgrid(np.linspace(-math.pi, math.pi, 361)[:-1], np.linspace(3.5, 8.0, 40))
    floor = np.column_stack((reaches.ravel(), bearings.ravel(), np.zeros(reaches.size)))
    floor[:, :2] = np.column_stack((floor[:, 0] * np.cos(floor[:, 1]), floor[:, 0] * np.sin(floor[:, 1])))
    across, up = np.meshgrid(np.linspace(-1.0, 1.0, 200), np.linspace(0.1, 0.4, 12))
    wall = np.column_stack((np.full(across.size, 3.0), across.ravel(), up.ravel()))
    behind_wall = (np.abs(np.arctan2(floor[:, 1], floor[:, 0])) < math.atan2(1.0, 3.0)) & (floor[:, 0] > 0.0)
    return np.vstack((floor[~behind_wall], wall))


def seen(points, roll, pitch):
    """The points as the lidar sees them from a tilted base; the angles may be one for each point."""
    roll, pitch = np.broadcast_to(roll, len(points)), np.broadcast_to(pitch, len(points))
    on_base = points - [0.0, 0.0, BASE_HEIGHT]
    turned = np.array(
        [
            rigid_transform((0.0, 0.0, 0.0, r, p, 0.0))[:3, :3].T @ point
            for r, p, point in zip(roll, pitch, on_base, strict=True)
        ]
    )
    return (turned - MOUNT[:3, 3]) @ MOUNT[:3, :3]


def posture(roll=0.0, pitch=0.0, pose=HERE, height=0.0, times=(0.0,), problem=""):
    tilts = np.column_stack(
        (times, np.broadcast_to(roll, len(times)), np.broadcast_to(pitch, len(times)))
    ).astype(float)
    return Posture(pose, height, tilts, problem)


def source(message, robot=GO2, by_tf=MOUNT, carrier=Carrier.BASE, **config):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return ScanSource(ScanConfig(**config), message, by_tf, robot, carrier)


def floor_beams(scan):
    """How many beams read something where there is neither wall nor floor above 5 cm."""
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    return int(np.isfinite(scan.ranges[np.abs(bearings) > math.atan2(1.0, 3.0) + scan.angle_increment]).sum())


def ahead(scan):
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    return float(scan.ranges[np.abs(bearings).argmin()])


def test_a_cloud_that_pitches_by_5_degrees_reads_the_wall_and_no_floor_once_it_is_levelled():
    pitch = math.radians(5.0)
    message = BagMaker().cloud(STAMP, seen(room(), 0.0, pitch))
    reader = source(message)
    untold, levelled = reader.raw(message), reader.raw(message, posture(0.0, pitch))
    assert floor_beams(untold) > 100
    assert floor_beams(levelled) == 0
    assert ahead(levelled) == pytest.approx(3.0, abs=CLOUD_RANGE)


@pytest.mark.parametrize("seed", range(5))
def test_however_the_base_is_tilted_the_scan_is_that_of_a_level_robot(seed):
    roll, pitch = np.random.default_rng(seed).uniform(-0.15, 0.15, 2)
    level = BagMaker().cloud(STAMP, seen(room(), 0.0, 0.0))
    tilted = BagMaker().cloud(STAMP, seen(room(), roll, pitch))
    reader = source(level)
    expected = reader.raw(level, posture()).ranges
    np.testing.assert_allclose(
        reader.raw(tilted, posture(roll, pitch)).ranges, expected, atol=CLOUD_RANGE, rtol=0.0
    )
    assert floor_beams(reader.raw(tilted)) > 0


def test_between_two_orientations_the_one_at_the_stamp_counts():
    message = BagMaker().cloud(STAMP, seen(room(), 0.0, 0.06))
    two = posture(0.0, (0.02, 0.1), times=(-0.05, 0.05))
    scan = source(message).raw(message, two)
    assert floor_beams(scan) == 0
    assert ahead(scan) == pytest.approx(3.0, abs=CLOUD_RANGE)


def test_points_with_a_time_are_levelled_by_the_orientation_at_their_time():
    """A Mid-360 takes 0.1 s for a cloud, in which a Go2 pitches by 4°."""
    points = room()
    after = np.random.default_rng(0).uniform(0.0, 0.1, len(points))
    pitch = 0.05 * np.sin(40.0 * after)
    on_lidar = seen(points, 0.0, pitch)
    samples = np.arange(-0.1, 0.2, 0.01)
    known = posture(0.0, 0.05 * np.sin(40.0 * samples), times=samples)
    timed = BagMaker().cloud(STAMP, on_lidar, times=STAMP + 1e9 * after)
    untimed = BagMaker().cloud(STAMP, on_lidar)
    reader = source(timed)
    assert floor_beams(reader.raw(timed, known)) == 0
    assert floor_beams(reader.raw(untimed, known)) > 100


def test_orientations_that_come_too_seldom_for_such_points_are_warned_of_once(says):
    points = room()
    after = np.linspace(0.0, 0.1, len(points))
    message = BagMaker().cloud(STAMP, seen(points, 0.0, 0.0), times=STAMP + 1e9 * after)
    reader = source(message)
    seldom = posture(0.0, (0.0, 0.05, 0.0), times=(-0.1, 0.0, 0.1))
    with says.warns():
        reader.read(message, seldom)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reader.read(message, seldom)
        level = posture(0.0, (0.0, 0.005, 0.0), times=(-0.1, 0.0, 0.1))
        source(message).read(message, level)
        untimed = BagMaker().cloud(STAMP, seen(points, 0.0, 0.0))
        source(untimed).read(untimed, seldom)


def test_without_an_orientation_the_cloud_is_read_as_it_is_and_that_is_said_once(says):
    message = BagMaker().cloud(STAMP, seen(room(), 0.0, 0.05))
    reader, unknown = source(message), posture(times=(), problem="its poses hold no roll and pitch")
    with says.warns():
        scan = reader.read(message, unknown)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reader.read(message, unknown)
    np.testing.assert_array_equal(scan.ranges, reader.read(message).ranges)


def test_a_robot_that_stays_level_needs_no_orientation():
    message = BagMaker().cloud(STAMP, seen(room(), 0.0, 0.05))
    reader = source(message, cloud=CloudConfig(level=False))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for known in (posture(0.0, 0.05), posture(times=(), problem="its poses hold no roll and pitch")):
            np.testing.assert_array_equal(reader.read(message, known).ranges, reader.read(message).ranges)


# Clouds that are level already


def registered(pose, height, frame="camera_init"):
    """The room in the odometry frame, as FAST-LIO registers it: its base is the lidar, at `pose` and `height` there."""
    transform = rigid_transform((pose.x, pose.y, height - LIDAR_HEIGHT, 0.0, 0.0, pose.yaw))
    return BagMaker().cloud(STAMP, room() @ transform[:3, :3].T + transform[:3, 3], frame)


@pytest.mark.parametrize("tilt", [0.0, 0.15])
@pytest.mark.parametrize("pose", [HERE, Pose(40.0, -7.0, 2.0)])
def test_a_cloud_in_the_odometry_frame_is_moved_by_the_pose_and_not_levelled_again(pose, tilt):
    message = registered(pose, 0.1)
    reader = source(message, by_tf=rigid_transform((1.0, 2.0, 0.1, 0.3, 0.0, 0.0)), carrier=Carrier.ODOMETRY)
    scan = reader.raw(message, posture(tilt, -tilt, pose, 0.1))
    assert floor_beams(scan) == 0
    assert ahead(scan) == pytest.approx(3.0, abs=CLOUD_RANGE)
    assert reader.mounted_by == "the pose"


def test_how_high_the_base_is_for_a_cloud_in_the_odometry_frame(says):
    message = registered(HERE, 0.0)
    with says.warns():
        ScanSource(ScanConfig(), message, None, GO2, Carrier.ODOMETRY)
    with says.raises(InputError):
        source(message, TURTLEBOT, carrier=Carrier.ODOMETRY)
    given = source(
        message, TURTLEBOT, carrier=Carrier.ODOMETRY, mount=[0.0, 0.0, LIDAR_HEIGHT, 0.0, 0.0, 0.0]
    )
    assert ahead(given.raw(message, posture())) == pytest.approx(3.0, abs=CLOUD_RANGE)


def test_a_cloud_of_a_frame_above_the_odometry_frame_is_refused(says):
    with says.raises(InputError):
        source(BagMaker().cloud(STAMP, room(), "map"), carrier=Carrier.MAP)


@pytest.mark.parametrize("tilt", [0.0, 0.15])
def test_a_cloud_between_odometry_and_base_is_level(tilt):
    """base_footprint is on the floor beneath base_link, however that is tilted when tf is read."""
    message = BagMaker().cloud(STAMP, room(), "base_footprint")
    by_tf = np.linalg.inv(rigid_transform((0.0, 0.0, BASE_HEIGHT, tilt, -tilt, 0.0)))
    reader = source(message, by_tf=by_tf, carrier=Carrier.LEVEL)
    scan = reader.raw(message, posture(tilt, -tilt))
    assert floor_beams(scan) == 0
    assert ahead(scan) == pytest.approx(3.0, abs=CLOUD_RANGE)


# The robot's own lidar


def test_a_cloud_is_projected_as_by_the_robots_own_lidar():
    near = np.array([[0.05, 0.0, -0.2], [15.0, 0.3, -0.2], [25.0, 5.0, -0.2]])
    message = BagMaker().cloud(STAMP, near)
    scan = source(message, by_tf=None).raw(message)
    assert len(scan.ranges) == GO2.lidar.num_beams == 360
    assert (scan.range_min, scan.range_max) == (GO2.lidar.range_min, GO2.lidar.range_max) == (0.1, 20.0)
    np.testing.assert_allclose(scan.ranges[np.isfinite(scan.ranges)], np.hypot(15.0, 0.3), atol=CLOUD_RANGE)


def test_a_cloud_is_projected_as_the_config_says_if_it_does():
    message = BagMaker().cloud(STAMP, np.array([[0.05, 0.0, -0.2], [9.0, 0.3, -0.2]]))
    cloud = CloudConfig(angle_increment=math.radians(0.5), range_max=8.0)
    scan = source(message, by_tf=None, range_min=0.0, cloud=cloud).raw(message)
    assert (len(scan.ranges), scan.range_min, scan.range_max) == (720, 0.0, 8.0)
    assert scan.ranges[np.isfinite(scan.ranges)] == pytest.approx([0.05])
    assert source(message, by_tf=None, range_max=7.0, cloud=cloud).raw(message).range_max == 7.0
