"""Which transforms join two frames, and what is read from a message."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.live import messages
from lme.live.frames import FramesConfig, TransformTree, message_frames
from lme.types import Pose
from tests.made_bags import BagMaker


def tree(*chain, **rolls):
    made, maker = TransformTree(), BagMaker()
    for parent, child, pose in chain:
        made.update(maker.transform(0, parent, child, Pose(*pose), rolls.get(child, 0.0)))
    return made


def test_transforms_are_chained_up_and_down():
    made = tree(
        ("odom", "base", (1, 0, math.pi / 2)), ("base", "laser", (0.2, 0, 0)), ("map", "odom", (5, 5, 0))
    )
    pose, down = messages.planar_matrix(made.lookup("map", "laser"))
    assert pose == pytest.approx((6.0, 5.2, math.pi / 2))
    assert not down
    there = made.lookup("laser", "map") @ made.lookup("map", "laser")
    np.testing.assert_allclose(there, np.eye(4), atol=1e-12)
    assert made.lookup("map", "elsewhere") is None
    assert made.chain("odom", "laser") == {"laser", "base"}


def odometry(odom):
    return SimpleNamespace(header=SimpleNamespace(frame_id=odom), child_frame_id="base_link")


def test_poses_of_another_frame_than_the_chosen_one_are_said(says):
    joined = tree(("map", "odom", (5, 5, 0)), ("odom", "base_link", (1, 0, 0)))
    with says.warns(match="frames.odom is map"):
        assert message_frames(FramesConfig(odom="map"), odometry("odom"), joined) == ("map", "base_link")


def test_a_frame_of_a_wrong_or_missing_name_is_renamed(recwarn):
    joined = tree(("map", "odom", (5, 5, 0)), ("odom", "base_link", (1, 0, 0)))
    for name in ("", "odom", "wheels", "base_link"):
        assert (
            message_frames(FramesConfig(odom="odom", base="base_link"), odometry(name), joined).odom == "odom"
        )
    assert not recwarn


def test_a_ring_of_frames_ends():
    made = tree(("a", "b", (1, 0, 0)), ("b", "a", (1, 0, 0)))
    assert made.lookup("c", "a") is None


def test_a_lidar_that_hangs_upside_down():
    pose, down = messages.planar_matrix(
        tree(("base", "laser", (0.1, 0, 0.5)), laser=math.pi).lookup("base", "laser")
    )
    assert down
    assert pose == pytest.approx((0.1, 0.0, 0.5))


@pytest.mark.parametrize("yaw", [0.0, 0.3, -2.0, math.pi, -3.1, 1e-9])
def test_a_heading_survives_its_quaternion(yaw):
    maker = BagMaker()
    assert messages.planar(maker.pose(Pose(0, 0, 0)).position, maker.quaternion(yaw)).yaw == pytest.approx(
        yaw
    )
