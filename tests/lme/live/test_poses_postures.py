"""What is known of the height and the tilt of the base, and by what."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.live.frames import Carrier, Frames, TransformTree, carrier_of
from lme.live.messages import SECOND, Tilt
from lme.live.poses import Postures, imu_tilt
from lme.perception.point_cloud import rigid_transform
from lme.types import Pose
from tests.made_bags import BagMaker

HERE, LEVEL, STALE = Pose(1.0, 2.0, 0.5), Tilt(0.0, 0.0), SECOND // 2
FRAMES = Frames("odom", "base_link")


def ms(number):
    return round(number * SECOND / 1000)


def at(postures, stamp):
    """Roll and pitch at a stamp, interpolated; None if unknown."""
    tilts = postures.at(stamp, HERE, STALE).tilts
    return [float(np.interp(0.0, tilts[:, 0], tilts[:, k])) for k in (1, 2)] if len(tilts) else None


def test_height_and_tilt_are_interpolated_between_poses():
    postures = Postures()
    for k in range(20):
        postures.add(ms(100 * k), 0.3 + 0.01 * k, Tilt(0.02 * k, -0.01 * k))
    found = postures.at(ms(550), HERE, STALE)
    assert found.pose == HERE
    assert found.height == pytest.approx(0.355)
    assert at(postures, ms(550)) == pytest.approx([0.11, -0.055])
    assert found.problem == ""
    assert (np.diff(found.tilts[:, 0]) > 0.0).all()
    assert found.tilts[0, 0] <= -0.1  # the points of a cloud may be measured before and after its stamp
    assert found.tilts[-1, 0] >= 0.1


def test_an_imu_says_the_tilt_while_the_poses_are_planar():
    postures = Postures()
    for k in range(20):
        postures.add(ms(100 * k), 0.0, LEVEL)
        postures.add_imu(ms(100 * k), Tilt(0.1, 0.01 * k))
    assert at(postures, ms(550)) == pytest.approx([0.1, 0.055])
    assert postures.at(ms(550), HERE, STALE).problem == ""
    postures.add(ms(2000), 0.0, Tilt(-0.1, 0.0))  # they are not
    assert at(postures, ms(2000)) == pytest.approx([-0.1, 0.0])


def test_that_nothing_says_the_tilt_is_a_problem_after_a_second(says):
    postures = Postures()
    for k in range(20):
        postures.add(ms(100 * k), 0.0, LEVEL)
    assert postures.at(ms(500), HERE, STALE) == (HERE, 0.0, pytest.approx(np.empty((0, 3))), "")
    says(postures.at(ms(1500), HERE, STALE).problem)


def test_an_imu_that_falls_silent_is_a_problem(says):
    postures = Postures()
    postures.add_imu(0, Tilt(0.1, 0.0))
    for k in range(20):
        postures.add(ms(100 * k), 0.0, LEVEL)
    found = postures.at(ms(1500), HERE, STALE)
    assert len(found.tilts) == 0
    says(found.problem)


@pytest.mark.parametrize("by_imu", [True, False])
def test_nobody_drives_upside_down(by_imu, says):
    """The IMU of the Go2's own lidar hangs upside down, and only tf can say so."""
    postures = Postures()
    for k in range(20):
        tilt = Tilt(math.radians(165.0), 0.05)
        postures.add(ms(100 * k), 0.0, LEVEL if by_imu else tilt)
        if by_imu:
            postures.add_imu(ms(100 * k), tilt)
    found = postures.at(ms(1500), HERE, STALE)
    assert len(found.tilts) == 0
    says(found.problem)


def test_of_a_long_drive_only_the_last_seconds_are_kept():
    postures = Postures()
    for k in range(20_000):
        postures.add(ms(10 * k), 0.0, Tilt(0.0, 1e-5 * k))
    assert at(postures, ms(199_900)) == pytest.approx([0.0, 0.1999])
    assert at(postures, 0) is None


class TestImu:
    """The tilt of the base by the messages of an IMU."""

    @pytest.mark.parametrize(("roll", "pitch"), [(0.1, -0.2), (-0.3, 0.02)])
    @pytest.mark.parametrize("yaw", [0.0, 2.5])
    def test_one_with_the_axes_of_the_base(self, roll, pitch, yaw):
        message = BagMaker().imu(0, yaw, Tilt(roll, pitch), "imu_link")
        assert imu_tilt(message, FRAMES, TransformTree()) == pytest.approx((roll, pitch))

    def test_one_that_hangs_upside_down_as_tf_says(self):
        make, connected = BagMaker(), TransformTree()
        connected.update(make.transform(0, "base_link", "imu_link", Pose(0.1, 0.0, 1.0), roll=math.pi))
        base = rigid_transform((0.0, 0.0, 0.0, 0.1, -0.05, 0.7))
        hung = base @ rigid_transform((0.0, 0.0, 0.0, math.pi, 0.0, 1.0))
        yaw = math.atan2(hung[1, 0], hung[0, 0])
        tilt = Tilt(math.atan2(hung[2, 1], hung[2, 2]), -math.asin(hung[2, 0]))
        message = make.imu(0, yaw, tilt, "imu_link")
        assert imu_tilt(message, FRAMES, connected) == pytest.approx((0.1, -0.05))

    @pytest.mark.parametrize("unknown", ["covariance", "zero", "NaN"])
    def test_one_that_measures_no_orientation(self, unknown):
        message = BagMaker().imu(0, 0.3, Tilt(0.1, 0.1))
        if unknown == "covariance":
            message.orientation_covariance[0] = -1.0
        else:
            value = 0.0 if unknown == "zero" else math.nan
            message.orientation = SimpleNamespace(**dict.fromkeys("xyzw", value))
        assert imu_tilt(message, FRAMES, TransformTree()) is None

    def test_the_identity_that_livox_leaves_in_ros_2_is_no_orientation(self, says):
        postures = Postures()
        for k in range(20):
            postures.add(ms(100 * k), 0.0, LEVEL)
            postures.add_imu(ms(100 * k), imu_tilt(BagMaker().imu(0), FRAMES, TransformTree()))
        found = postures.at(ms(1500), HERE, STALE)
        assert len(found.tilts) == 0
        says(found.problem)


@pytest.mark.parametrize(
    ("name", "carrier"),
    [
        ("laser", Carrier.BASE),
        ("base_link", Carrier.BASE),
        ("unknown", Carrier.BASE),
        ("base_footprint", Carrier.LEVEL),
        ("odom", Carrier.ODOMETRY),
        ("map", Carrier.MAP),
    ],
)
def test_what_carries_a_frame(name, carrier):
    make, found = BagMaker(), TransformTree()
    for parent, child in (
        ("map", "odom"),
        ("odom", "base_footprint"),
        ("base_footprint", "base_link"),
        ("base_link", "laser"),
    ):
        found.update(make.transform(0, parent, child, Pose(0.0, 0.0, 0.0)))
    assert carrier_of(name, FRAMES, found) is carrier


def test_the_odometry_frame_is_known_without_tf():
    assert carrier_of("camera_init", Frames("camera_init", "body"), TransformTree()) is Carrier.ODOMETRY
