"""The live driver and the scan: missing, stale, empty, late or of another size, it stops the robot."""

import math

import numpy as np
import pytest

from tests.lme.live.rig import FAR, drives, stands
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

    wall = np.column_stack((np.full(50, 3.0), np.linspace(-1.0, 1.0, 50), np.full(50, 0.2)))
    see(wall)
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert drives(see(wall))
    assert stands(see(points), "the scan is empty")
    floor = wall * [1.0, 1.0, 0.0]
    assert drives(see(floor))  # all that is seen is below the heights that count


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
