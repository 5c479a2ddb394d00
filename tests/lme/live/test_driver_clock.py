"""The live driver and the clock: stamps, jumps, and a clock that stands still."""

import numpy as np
import pytest

from lme.live.driver import Clock
from lme.live.step import LiveState
from lme.types import Pose
from tests.lme.live.rig import FAR, PERIOD, Rig, drives, stands
from tests.made_bags import SECOND


def test_a_clock_that_differs_from_the_robots_is_named_and_may_be_ignored(rig):
    trusting = Rig(clock="received")
    for one in (rig, trusting):
        one.driver.set_goal(FAR, "odom", one.now)
        for _ in range(3):
            one.pass_time()
            one.odometry(stamp=one.now + 5 * SECOND)
            one.scan(stamp=one.now + 5 * SECOND)
            step = one.tick()
        expected = stands if one is rig else drives
        assert expected(step, *(["no scan (its stamp is 5.0 s ahead"] if one is rig else []))


def test_stamps_that_are_not_set_are_those_of_arrival(rig):
    rig.drive()
    rig.pass_time()
    rig.odometry(stamp=0)
    rig.scan(stamp=0)
    assert drives(rig.tick())
    rig.pass_time(0.6)
    rig.odometry(stamp=0)
    assert stands(rig.tick(), "the scan is older than 0.5 s")


@pytest.mark.parametrize(("by", "way"), [(30.0, "forwards by 30 s"), (-30.0, "backwards by 30 s")])
@pytest.mark.parametrize("told_by", ["tick", "scan"])
def test_after_a_jump_in_time_only_fresh_data_count(rig, by, way, told_by):
    rig.drive()
    rig.now += round(by * SECOND)
    if told_by == "scan":
        rig.scan(stamp=rig.now - 40 * SECOND)
    assert stands(rig.tick(), f"the clock jumped {way}")
    rig.pass_time(0.05)
    assert stands(rig.tick(), "no scan")
    rig.scan()
    assert stands(rig.tick(), "no odometry")
    assert drives(rig.period())


def test_moving_transforms_must_come_again_after_a_jump(rig):
    rig.transform("map", "odom")
    rig.transform("base_link", "laser", Pose(0.2, 0.0, 0.0), static=True)
    rig.sense()
    rig.tick()
    rig.driver.set_goal(FAR, "map", rig.now)
    assert drives(rig.period())
    rig.now -= 30 * SECOND
    rig.tick()
    assert stands(rig.period(), "no transform of odom")
    rig.transform("map", "odom")
    assert drives(rig.period())
    assert rig.driver.mounted_by == "tf"


def test_a_stopped_clock_stops_the_driver_by_wall_time(rig):
    last = rig.drive()
    for _ in range(2):
        rig.wall += PERIOD
        assert rig.tick() == last
    rig.wall += PERIOD
    assert stands(rig.tick(), "the clock stands still")
    assert drives(rig.period())


def test_a_decision_is_made_once_for_each_time(rig):
    """Also if the soft stop has halted it."""
    rig.drive()
    rig.pass_time()
    rig.odometry(v=0.5)
    rig.scan(ranges=np.full(540, 0.21))
    step = rig.tick()
    assert stands(step, "soft stop")
    count = len(rig.puppet.seen)
    assert rig.tick() is step
    assert len(rig.puppet.seen) == count


def test_a_cancel_counts_while_the_clock_stands_still(rig):
    rig.drive()
    rig.driver.cancel()
    assert stands(rig.tick(), "cancelled", LiveState.CANCELLED)


def read(*seconds):
    """What is said of each of these times."""
    clock = Clock(SECOND, lambda: 0)
    return [clock.read(round(100 * SECOND + one * SECOND)) for one in seconds]


def test_time_that_passes_is_not_a_jump():
    assert read(0.0, 0.2, 0.2, 1.2, 1.15, 2.1) == [""] * 6


@pytest.mark.parametrize("by", [1.1, -0.2, 1e6, -99.0])
def test_a_jump_of_the_clock_is_reported_once(by, says):
    said = read(0.0, by, by + 0.2)
    assert said[0] == said[2] == ""
    says(said[1])


def test_threads_that_swap_two_readings_do_not_hide_a_standstill():
    wall = [0]
    clock = Clock(SECOND, lambda: wall[0])
    clock.read(SECOND)
    for k in range(10):
        wall[0] += SECOND
        clock.read(SECOND - (k % 2) * SECOND // 20)
    assert clock.stalled_for == 10 * SECOND
    clock.read(SECOND + 1)
    assert clock.stalled_for == 0
