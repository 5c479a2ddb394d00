"""What a replay finds in the first messages: twists and headings that can be believed."""

import warnings

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.errors import InputError
from lme.live.frames import FramesConfig
from runners.recordings.bags import Bag
from runners.recordings.posed_scans import PosedScans
from runners.recordings.recording import inspect
from runners.recordings.topics import BagTopicsConfig, choose
from tests.made_bags import SECOND, drive

STALE = SECOND // 2


def changed(folder, change, steps=60):
    """The path of a drive whose odometry messages have been changed by their number."""
    folder.mkdir(exist_ok=True)
    maker = drive(steps=steps)
    odometry = [message for _, topic, _, message in maker.messages if topic == "/odom"]
    for number, message in enumerate(odometry):
        change(number, message)
    return maker.write(folder)


def motions(path, **topics):
    """The motion at every scan."""
    with Bag(path) as bag:
        recording = inspect(bag, choose(bag, BagTopicsConfig(**topics), None), FramesConfig(), "auto")
        scans, found = PosedScans(recording, STALE), []
        for message in bag.messages(recording.topics.names):
            found += [one.motion for one in scans.ready(message)]
            scans.take(message)
        return recording, [*found, *(one.motion for one in scans.ready(None))]


def no_twist(_, message):
    message.twist.twist.linear.x = message.twist.twist.angular.z = 0.0


def in_mm(_, message):
    message.twist.twist.linear.x *= 1000.0


@pytest.mark.parametrize(
    "change",
    [no_twist, in_mm],
)
def test_a_twist_that_contradicts_the_poses_is_replaced_by_their_slope(tmp_path, change, says):
    path = changed(tmp_path, change)
    with says.warns() as said:
        _, found = motions(path)
    assert len(said) == 1
    speeds = np.array([motion.twist.v for motion in found])
    np.testing.assert_allclose(speeds[3:], 0.25, atol=0.01)


def test_velocities_are_the_slope_of_the_poses_where_that_is_asked_for(tmp_path, says):
    path = changed(tmp_path, in_mm)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, found = motions(path, twist="poses")
    np.testing.assert_allclose([motion.twist.v for motion in found[3:]], 0.25, atol=0.01)
    with says.raises(InputError, match="twist.*poes"):
        BagTopicsConfig(twist="poes")


def test_twists_that_become_wrong_are_replaced_from_then_on(tmp_path):
    path = changed(tmp_path, lambda k, message: no_twist(k, message) if k > 70 else None, steps=160)
    with pytest.warns(UserWarning, match="contradict"):
        _, found = motions(path)
    assert found[60].twist.v == 0.25
    assert found[90].twist.v == 0.0
    assert found[-1].twist.v == pytest.approx(0.25, abs=0.01)


def test_a_right_recording_is_read_as_it_is(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, found = motions(changed(tmp_path, lambda *_: None))
    assert {motion.twist.v for motion in found} == {0.25}


def unset(message):
    message.pose.pose.orientation.w = message.pose.pose.orientation.z = 0.0


def test_poses_without_a_heading_are_refused(tmp_path, says):
    path = changed(tmp_path, lambda _, message: unset(message))
    with says.raises(InputError):
        motions(path)


def test_a_pose_without_a_heading_does_not_count(tmp_path):
    path = changed(tmp_path, lambda k, message: unset(message) if k % 5 == 0 else None)
    _, found = motions(path)
    assert all(motion.pose.yaw != 0.0 for motion in found)


def test_a_quaternion_that_is_not_normalised_is_the_same_heading(tmp_path):
    def longer(_, message):
        for key in "xyzw":
            setattr(message.pose.pose.orientation, key, 3.0 * getattr(message.pose.pose.orientation, key))

    _, right = motions(changed(tmp_path / "one", lambda *_: None))
    _, found = motions(changed(tmp_path / "two", longer))
    np.testing.assert_allclose([m.pose for m in found], [m.pose for m in right], atol=1e-12)


@pytest.mark.parametrize(
    ("header", "child", "frames"),
    [
        ("base_link", "odom", ("odom", "base_link")),
        ("base_link", "base_link", ("odom", "base_link")),
        ("odom", "odom", ("odom", "base_link")),
        ("robot/base_link", "robot/odom", ("robot/odom", "base_link")),
    ],
)
def test_frames_that_are_swapped_or_equal_are_read_as_they_are_meant(tmp_path, header, child, frames, says):
    def rename(_, message):
        message.header.frame_id, message.child_frame_id = header, child

    with says.warns():
        recording, _ = motions(changed(tmp_path, rename, steps=12))
    assert recording.frames == frames
