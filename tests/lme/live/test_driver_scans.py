"""The live driver and the scan: missing, stale, empty, late or of another size, it stops the robot."""

import math

import numpy as np
import pytest

from lme.live.config import ScanConfig
from tests import builders
from tests.lme.live.rig import FAR, Rig, drives, stands
from tests.made_bags import SECOND


def test_without_a_scan_the_driver_stands(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.odometry()
    assert stands(rig.tick(), "no scan")


def test_a_stale_scan_stops_the_driver_until_a_fresh_one_comes(rig):
    rig.drive()
    for _ in range(2):
        rig.pass_time()
        rig.odometry()
        assert drives(rig.tick())
    rig.pass_time()
    rig.odometry()
    assert stands(rig.tick(), "the scan is older than 0.5 s")
    assert drives(rig.period())


@pytest.mark.parametrize(
    "ranges", [[math.nan] * 540, [0.0] * 540, [0.01] * 540], ids=["NaN", "0", "too near"]
)
def test_an_empty_scan_stops_the_driver(rig, ranges):
    rig.drive()
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.array(ranges))
    assert stands(rig.tick(), "the scan is empty")
    assert drives(rig.period())


@pytest.mark.parametrize(
    "points", [np.empty((0, 3)), np.full((50, 3), math.nan), np.zeros((50, 3))], ids=["none", "NaN", "0"]
)
def test_an_empty_cloud_stops_the_driver(rig, points):
    def see(points):
        rig.pass_time()
        rig.odometry()
        rig.driver.take_scan(rig.make.cloud(rig.now, points), rig.now)
        return rig.tick()

    wall = np.column_stack((np.full(50, 3.0), np.linspace(-1.0, 1.0, 50), np.full(50, 0.1)))
    rig.transform("base_link", "laser", static=True)  # 0.2 m above the floor
    see(wall)
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert drives(see(wall))
    assert stands(see(points), "the scan is empty")
    floor = wall - [0.0, 0.0, 0.3]
    assert stands(see(floor), "none of the 50 points within 15 m is between 0.05 and 0.5 m high")
    assert drives(see(wall))


def test_with_fresh_scans_in_the_open_the_driver_drives(rig):
    """A beam that meets nothing within range measures something: that nothing is there."""
    rig.drive()
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.full(540, math.inf))
    assert drives(rig.tick())


def test_scans_out_of_order_and_late_ones_do_not_count(rig):
    rig.drive()
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.full(540, 2.0))
    rig.scan(stamp=rig.now - SECOND // 10, ranges=np.full(540, 1.0))
    assert rig.tick().observation.scan.ranges[0] == 2.0
    for _ in range(3):
        rig.pass_time()
        rig.odometry()
        rig.scan(stamp=rig.now - SECOND)
        step = rig.tick()
    assert stands(step, "the scan is older than 0.5 s (its stamp is 1.0 s behind the clock")


@pytest.mark.parametrize("first", [3, 135], ids=["coarse", "finer"])
def test_a_first_scan_that_is_not_whole_does_not_blind_the_robot(rig, first):
    rig.odometry()
    rig.scan(ranges=np.full(first, 3.0))
    rig.tick()  # prepares for this lidar
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(rig.period(), "being prepared")
    assert rig.driver.robot.lidar.num_beams == 540
    assert drives(rig.period())
    ahead = np.abs(np.linspace(-math.pi, math.pi, 540, endpoint=False)) < 0.5
    rig.pass_time()
    rig.odometry(v=0.3)
    rig.scan(ranges=np.where(ahead, 0.27, 3.0))
    assert stands(rig.tick(), "soft stop")


def test_the_driver_stands_until_guide_and_planner_are_prepared_for_another_lidar(rig):
    rig.odometry()
    rig.scan(ranges=np.full(180, 3.0))
    rig.tick()
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.full(180, 3.0))
    assert drives(rig.tick())
    assert stands(rig.period(), "must be prepared")
    assert stands(rig.period(), "being prepared")
    assert drives(rig.period())


def implausible(maker, now, kind):
    """A LaserScan of a driver that is set up wrongly."""
    bearings = np.linspace(-math.pi, math.pi, 540, endpoint=False)
    room = 3.0 / np.maximum(np.abs(np.sin(bearings)), np.abs(np.cos(bearings)))
    ranges, first, increment, limits = {
        "degrees": (room, -180.0, 360 / 540, (0.02, 15.0)),
        "millimetres": (1000.0 * room, -math.pi, math.tau / 540, (20.0, 15000.0)),
        "millimetres, but for the limits": (1000.0 * room, -math.pi, math.tau / 540, (0.02, 15.0)),
        "two turns": (np.tile(room, 2), -math.pi, math.tau / 540, (0.02, 15.0)),
        "below range_min": (room, -math.pi, math.tau / 540, (4.0, 15.0)),
        "NaN": (math.nan * room, -math.pi, math.tau / 540, (0.02, 15.0)),
    }[kind]
    return maker.scan(now, ranges, first, increment, limits)


@pytest.mark.parametrize(
    ("kind", "reason"),
    [
        ("degrees", "must be in radians"),
        ("millimetres", "must be in metres"),
        ("millimetres, but for the limits", "these look like millimetres"),
        ("two turns", "2 turns"),
        ("below range_min", "below range_min 4 m"),
        ("NaN", "measures anything"),
    ],
)
def test_on_an_implausible_scan_the_robot_stands(rig, kind, reason):
    """From the first scan on, and in the middle of a drive; then it drives with the lidar that it has."""
    for _ in range(2):
        rig.pass_time()
        rig.odometry()
        rig.driver.take_scan(implausible(rig.make, rig.now, kind), rig.now)
        rig.driver.set_goal(FAR, "odom", rig.now)
        assert stands(rig.tick(), reason)
    assert stands(rig.period(), "being prepared")
    assert drives(rig.period())
    rig.pass_time()
    rig.odometry()
    rig.driver.take_scan(implausible(rig.make, rig.now, kind), rig.now)
    step = rig.tick()
    if "wider" not in step.reason:
        assert stands(step, reason)
    assert drives(rig.period())
    assert rig.driver.robot.lidar.num_beams == 540


@pytest.mark.parametrize("part", [0.25, 0.8])
@pytest.mark.parametrize("lidar", ["recorded", "robot"])
def test_on_a_part_of_a_scan_the_robot_stands(part, lidar):
    rig = Rig(scan=ScanConfig(lidar=lidar))
    rig.drive()
    rig.pass_time()
    rig.odometry()
    scan = rig.make.scan(rig.now, np.full(round(540 * part), 3.0), -math.pi, math.tau / 540, (0.02, 15.0))
    rig.driver.take_scan(scan, rig.now)
    assert stands(rig.tick(), "it is not a whole scan")
    assert drives(rig.period())


def test_on_a_scan_of_another_lidar_the_robot_stands(rig):
    rig.drive()
    rig.pass_time()
    rig.odometry()
    scan = rig.make.scan(rig.now, np.full(540, 3.0), -math.pi, math.tau / 540, (0.02, 15.0))
    scan.header.frame_id = "rear"
    rig.driver.take_scan(scan, rig.now)
    assert stands(rig.tick(), "from the frame rear, not from laser")
    assert drives(rig.period())


def test_a_lidar_on_its_side_is_refused():
    rig = Rig(scan=ScanConfig(mount=[0.0, 0.0, 0.2, math.pi / 2, 0.0, 0.0]))
    rig.sense()
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(rig.period(), "scan.mount tilts the lidar by 90°")


def wall_ahead(heights):
    """Points 1.5 m ahead of the robot, in a frame on the floor."""
    across, up = np.meshgrid(np.linspace(-2.0, 2.0, 200), heights)
    return np.column_stack((np.full(across.size, 1.5), across.ravel(), up.ravel()))


def sees(rig, points):
    rig.pass_time()
    rig.odometry()
    rig.driver.take_scan(rig.make.cloud(rig.now, points), rig.now)
    return rig.tick()


def test_without_tf_the_robot_says_how_high_the_lidar_of_a_cloud_is():
    """A Go2 took it to be on the floor, cut every point of a wall away and drove into it."""
    rig = Rig(robot=builders.shipped("go2"))
    rig.driver.set_goal(FAR, "odom", rig.now)
    for _ in range(3):
        step = sees(rig, wall_ahead([0.1, 0.3]) - [0.0, 0.0, 0.45])
    assert drives(step)
    assert np.nanmin(step.observation.scan.ranges) == pytest.approx(1.5, abs=0.01)
    assert rig.driver.mounted_by == "robot=go2"


@pytest.mark.parametrize("heights", [[0.6, 1.0], [-0.2, 0.0], [0.0]], ids=["above", "below", "floor"])
def test_where_no_point_is_between_the_heights_the_robot_stands(heights):
    rig = Rig(scan=ScanConfig(mount=[0.0, 0.0, 0.45, 0.0, 0.0, 0.0]))
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(sees(rig, wall_ahead(heights) - [0.0, 0.0, 0.45]), "is between 0.05 and 0.5 m high")
    for _ in range(2):
        step = sees(rig, wall_ahead([0.2]) - [0.0, 0.0, 0.45])
    assert drives(step)
    assert stands(sees(rig, wall_ahead(heights) - [0.0, 0.0, 0.45]), "is between 0.05 and 0.5 m high")


def test_a_cloud_in_millimetres_stops_the_robot():
    rig = Rig(robot=builders.shipped("go2"))
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(sees(rig, 1000.0 * wall_ahead([0.1, 0.3])), "these look like millimetres")


def test_a_cloud_whose_height_nobody_knows_stops_the_robot_until_tf_comes(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(sees(rig, wall_ahead([0.1])), "set scan.mount=[x, y, z, roll, pitch, yaw]")
    rig.transform("base_link", "laser", static=True)
    for _ in range(2):
        step = sees(rig, wall_ahead([0.1]))
    assert drives(step)
