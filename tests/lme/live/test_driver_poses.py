"""The live driver and the robot's pose: from odometry or tf, fresh, finite, and at the time of the scan."""

import math
import warnings

import pytest

from lme.live.frames import FramesConfig
from lme.live.step import LiveState
from lme.types import Pose, Twist
from tests.lme.live.rig import FAR, Rig, drives, stands
from tests.made_bags import SECOND


def test_without_odometry_the_driver_stands(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.scan()
    rig.tick()
    assert stands(rig.tick(), "no odometry")


def test_stale_odometry_stops_the_driver(rig):
    rig.drive()
    for _ in range(3):
        rig.pass_time()
        rig.scan()
        step = rig.tick()
    assert stands(step, "the odometry is older than 0.5 s")
    assert drives(rig.period())


@pytest.mark.parametrize("x", [math.nan, math.inf, -1e230])
def test_odometry_that_is_not_a_number_or_absurd_does_not_count(rig, x):
    rig.drive()
    for _ in range(3):
        rig.pass_time()
        rig.scan()
        rig.odometry(pose=Pose(x, 0.0, 0.0))
        step = rig.tick()
    assert stands(step, "the odometry is older than 0.5 s (it is not finite, or absurdly large)")


def test_between_two_poses_the_one_at_the_scans_stamp_counts(rig):
    rig.drive()
    rig.pass_time()
    rig.scan(stamp=rig.now - SECOND // 10)
    rig.odometry(pose=Pose(0.2, 0.0, 0.0), v=1.0)
    seen = rig.tick().observation
    assert seen.odometry.x == pytest.approx(0.1)
    assert seen.twist.v == pytest.approx(0.5)
    assert seen.target[0] == pytest.approx(9.9)


def test_poses_by_tf_and_their_twist(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    for k in range(8):
        rig.pass_time(0.1)
        rig.transform("odom", "base_link", Pose(0.04 * k, 0.0, 0.0))
        rig.scan()
        step = rig.tick()
    assert drives(step)
    assert step.observation.twist == pytest.approx((0.4, 0.0))
    for _ in range(3):
        rig.pass_time()
        rig.scan()
        step = rig.tick()
    assert stands(step, "the odometry is older than 0.5 s")


def test_a_transform_of_the_robot_that_is_not_a_number_is_reported(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.transform("odom", "base_link", Pose(math.nan, 0.0, 0.0))
    rig.scan()
    rig.tick()
    assert stands(rig.tick(), "no odometry (the transform of base_link is not finite)")


def test_once_odometry_has_come_tf_does_not_replace_it(rig):
    rig.drive()
    for _ in range(3):
        rig.pass_time()
        rig.transform("odom", "base_link")
        rig.scan()
        step = rig.tick()
    assert stands(step, "the odometry is older than 0.5 s")


def test_odometry_without_a_heading_does_not_count(rig):
    message = rig.make.odometry(rig.now, Pose(0.0, 0.0, 0.0), 0.0, 0.0)
    for key in "xyzw":
        object.__setattr__(message.pose.pose.orientation, key, 0.0)
    rig.scan()
    rig.tick()
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.pass_time()
    rig.scan()
    rig.driver.take_odometry(message, rig.now)
    assert stands(rig.tick(), "no odometry (its quaternion is zero)")


def test_the_latest_motion_comes_with_every_step(rig):
    assert rig.tick().motion is None
    rig.drive()
    rig.pass_time()
    rig.scan()
    rig.odometry(pose=Pose(9.9, 0.0, 0.0), v=0.3)
    step = rig.tick()
    assert step.state is LiveState.ARRIVED
    assert step.motion == (rig.now, Pose(9.9, 0.0, 0.0), Twist(0.3, 0.0))


def test_a_transform_that_is_not_a_number_is_left_out(rig):
    rig.transform("base_link", "laser", static=True)
    rig.transform("base_link", "laser", Pose(math.nan, 0.0, 0.0), static=True)
    rig.drive()
    assert drives(rig.period())


def test_names_of_frames_that_are_given(rig):
    rig = Rig(frames=FramesConfig("/world", "robot"))
    rig.drive()
    assert rig.driver.frames == ("world", "robot")


def moves(rig, seconds, said=0.0, yaw=math.pi / 2):
    """The step after a robot has driven along its heading at 0.5 m/s, and said so."""
    rig.driver.set_goal(FAR, "odom", rig.now)
    for k in range(round(10 * seconds)):
        rig.pass_time(0.1)
        way = 0.05 * k
        rig.odometry(pose=Pose(way * math.cos(yaw), way * math.sin(yaw), yaw), v=said)
        rig.scan()
        step = rig.tick()
    return step


def test_twists_that_contradict_the_poses_are_replaced_by_their_slope(rig, says):
    """As from a driver that means another unit."""
    with says.warns():
        step = moves(rig, 6.0, said=50.0)
    assert step.observation.twist == pytest.approx((0.5, 0.0))


def test_a_robot_that_moves_and_always_says_zero_is_noticed_within_a_second(rig, says):
    """As with FAST-LIO, which never sets its twist."""
    with says.warns() as said:
        step = moves(rig, 1.3)
    assert [str(one.message) for one in said if "twist" in str(one.message)] == [str(said[-1].message)]
    assert step.observation.twist == pytest.approx((0.5, 0.0))


def test_velocities_may_come_from_the_poses_from_the_start():
    rig = Rig(measured_twists=False)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="odometry")
        step = moves(rig, 0.5)
    assert step.observation.twist == pytest.approx((0.5, 0.0))
