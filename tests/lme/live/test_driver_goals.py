"""The live driver and its goal: reached, cancelled, replaced, and given in any frame."""

import math

import numpy as np
import pytest

from lme.errors import InputError
from lme.live.step import LiveState
from lme.types import Pose
from tests.lme.live.rig import FAR, drives, stands


def test_the_goal_of_the_barn_challenge_lies_ahead(rig):
    """(0, 10) in odom, of a robot that is turned by 90° there."""
    pose = Pose(0.0, 0.0, math.pi / 2)
    for _ in range(2):
        rig.pass_time()
        rig.odometry(pose=pose)
        rig.scan()
        rig.driver.set_goal((0.0, 10.0), "odom", rig.now)
        step = rig.tick()
    np.testing.assert_allclose(step.observation.target, (10.0, 0.0), atol=1e-12)


def test_without_a_goal_the_driver_stands(rig):
    assert stands(rig.tick(), "no goal", LiveState.IDLE)
    assert "prepared" in rig.period().reason
    assert stands(rig.period(), "no goal", LiveState.IDLE)


def test_at_the_goal_the_driver_stands_until_the_next_goal(rig):
    rig.drive()
    rig.pass_time()
    rig.scan()
    rig.odometry(pose=Pose(9.81, 0.0, 0.0))
    assert stands(rig.tick(), "arrived", LiveState.ARRIVED)
    assert stands(rig.period(), "arrived", LiveState.ARRIVED)
    rig.driver.set_goal(FAR, "odom", rig.now)
    step = rig.period()
    assert drives(step)
    assert step.goal == 2


def test_a_cancelled_goal(rig):
    rig.drive()
    rig.driver.cancel()
    assert stands(rig.period(), "cancelled", LiveState.CANCELLED)
    rig.driver.cancel()
    assert stands(rig.period(), "cancelled", LiveState.CANCELLED)


def test_a_new_goal_takes_the_place_of_the_old_one(rig):
    rig.drive()
    before = rig.puppet.resets
    rig.driver.set_goal((0.0, 7.0), "", rig.now)
    step = rig.period()
    np.testing.assert_allclose(step.observation.target, (0.0, 7.0))
    assert (step.goal, rig.puppet.resets) == (2, before + 2)  # the guide's and the planner's


@pytest.mark.parametrize("goal", [(math.nan, 0.0), (1.0,), (1.0, math.inf)])
def test_a_goal_must_be_a_position(rig, goal, says):
    with says.raises(InputError):
        rig.driver.set_goal(goal, "odom", rig.now)


def test_a_goal_on_the_map_moves_with_localisation(rig):
    rig.sense()
    rig.tick()
    rig.driver.set_goal((1.0, 5.0), "/map", rig.now)
    assert stands(rig.period(), "tf does not connect the frame of the goal, map, to odom")
    for shift in (1.0, 2.0):
        rig.transform("map", "odom", Pose(shift, 0.0, math.pi / 2))
        np.testing.assert_allclose(rig.period().observation.target, (5.0, shift - 1.0), atol=1e-12)
    for _ in range(2):
        step = rig.period()
    assert stands(step, "the transform of odom is older than 0.5 s")


def test_a_transform_that_is_sent_again_and_again_gets_old(rig):
    """Its stamp counts, not when it comes."""
    rig.sense()
    rig.tick()
    rig.driver.set_goal((1.0, 5.0), "map", rig.now)
    old = rig.make.transform(rig.now, "map", "odom", Pose(1.0, 0.0, 0.0))
    for _ in range(4):
        rig.driver.take_transforms(old, rig.now)
        step = rig.period()
    assert stands(step, "the transform of odom is older than 0.5 s")


def test_a_static_transform_never_gets_old(rig):
    rig.transform("map", "odom", static=True)
    rig.sense()
    rig.tick()
    rig.driver.set_goal(FAR, "map", rig.now)
    for _ in range(5):
        assert drives(rig.period())


def test_a_goal_in_the_base_frame_stays_where_it_was(rig):
    rig.sense()
    rig.tick()
    rig.driver.set_goal((3.0, 1.0), "base_link", rig.now)
    rig.pass_time()
    rig.scan()
    rig.odometry(pose=Pose(1.0, 0.0, 0.0))
    np.testing.assert_allclose(rig.tick().observation.target, (2.0, 1.0))


@pytest.mark.parametrize("by_tf", [True, False])
def test_a_goal_in_the_frame_of_a_sensor_stays_where_it_was(rig, by_tf):
    """A camera's, say. Its frame moves with the robot; the goal must not."""
    rig.transform("base_link", "camera", Pose(0.5, 0.0, math.pi / 2), static=True)
    rig.sense()
    rig.tick()
    if by_tf:
        rig.transform("odom", "base_link")
    rig.driver.set_goal((3.0, 0.0), "camera", rig.now)
    rig.period()
    rig.pass_time()
    rig.scan()
    rig.odometry(pose=Pose(1.0, 0.0, 0.0))
    if by_tf:
        rig.transform("odom", "base_link", Pose(1.0, 0.0, 0.0))
    np.testing.assert_allclose(rig.tick().observation.target, (-0.5, 3.0), atol=1e-12)
