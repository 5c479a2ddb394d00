"""The live driver of a robot that walks: its clouds, levelled by whatever says how it is tilted."""

import math
import warnings

import numpy as np
import pytest

from lme.geometry.frames import compose
from lme.live.messages import Tilt
from lme.live.step import LiveState
from lme.perception.point_cloud import rigid_transform
from lme.types import Pose
from tests import builders
from tests.lme.live.rig import FAR, Rig, drives, stands
from tests.made_bags import SECOND
from tests.tolerances import CLOUD_RANGE

HEIGHT = 0.45  # [m] of the lidar of a Go2
WALL = 3.0  # [m]


def room():
    """Points (N, 3) of a floor 4 to 8 m from a level robot, and of a wall ahead, from the floor beneath it."""
    bearings, reaches = np.meshgrid(np.linspace(0.5, math.tau - 0.5, 300), np.linspace(4.0, 8.0, 20))
    across, up = np.meshgrid(np.linspace(-1.0, 1.0, 200), np.linspace(0.1, 0.4, 12))
    floor = np.column_stack(
        (*(reaches * (np.cos(bearings), np.sin(bearings))).reshape(2, -1), np.zeros(reaches.size))
    )
    return np.vstack((floor, np.column_stack((np.full(across.size, WALL), across.ravel(), up.ravel()))))


class Go2(Rig):
    """Its base is the lidar, as FAST-LIO has it; it rocks, and `message` makes what the lidar says."""

    def __init__(self, frame="body", odom="camera_init", **config):
        super().__init__(robot=builders.shipped("go2"), measured_twists=False, **config)
        self.frame, self.odom = frame, odom
        self.pose, self.steps = Pose(20.0, -3.0, 1.0), 0
        self.driver.set_goal(FAR, odom, self.now)

    def walk(self, steps, said=lambda tilt: tilt, imu=None):
        """Walk, and return the last step. said: the tilt that odometry says. imu: makes messages of an IMU."""
        for _ in range(steps):
            self.pass_time(0.1)
            self.steps += 1
            self.pose = compose(self.pose, Pose(0.03, 0.0, 0.02))
            tilt = Tilt(0.06 * math.sin(self.steps), 0.1 * math.cos(2.0 * self.steps))
            odometry = self.make.odometry(self.now, self.pose, 0.0, 0.0, 0.02, said(tilt))
            odometry.header.frame_id, odometry.child_frame_id = self.odom, "body"
            self.driver.take_odometry(odometry, self.now)
            if imu is not None:
                self.driver.take_imu(imu(self.now, self.pose.yaw, tilt), self.now)
            self.driver.take_scan(self.make.cloud(self.now, self.seen(tilt), self.frame), self.now)
            step = self.tick()
        return step

    def seen(self, tilt):
        on_base = room() - [0.0, 0.0, HEIGHT]
        if self.frame == self.odom:
            turn = rigid_transform((self.pose.x, self.pose.y, 0.02, 0.0, 0.0, self.pose.yaw))
            return on_base @ turn[:3, :3].T + turn[:3, 3]
        return on_base @ rigid_transform((0.0, 0.0, 0.0, *tilt, 0.0))[:3, :3]


def floor_beams(step):
    """How many beams read something, beside the wall."""
    assert drives(step)
    scan = step.observation.scan
    bearings = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    wide = math.atan2(1.0, WALL) + scan.angle_increment
    return int(np.isfinite(scan.ranges[np.abs(bearings) > wide]).sum())


def sees_the_wall_alone(step):
    scan = step.observation.scan
    assert scan.ranges[len(scan.ranges) // 2] == pytest.approx(WALL, abs=CLOUD_RANGE)
    return floor_beams(step) == 0


def level(tilt):
    return Tilt(0.0, 0.0)


@pytest.mark.parametrize("frame", ["body", "camera_init", "livox_frame"])
def test_clouds_are_levelled_by_odometry_with_roll_and_pitch(frame):
    """FAST-LIO's clouds in its two frames, and one in a frame that tf does not know."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="a cloud is read as if")
        assert sees_the_wall_alone(Go2(frame).walk(30))


def test_without_roll_and_pitch_the_floor_is_taken_for_obstacles_and_that_is_said(says):
    with says.warns():
        step = Go2().walk(30, level)
    assert floor_beams(step) > 50


def test_clouds_are_levelled_by_an_imu_while_odometry_is_planar():
    rig = Go2()

    def imu(stamp, yaw, tilt):
        return rig.make.imu(stamp, yaw, tilt, "body")

    with warnings.catch_warnings():
        warnings.filterwarnings("error", message="a cloud is read as if")
        assert sees_the_wall_alone(rig.walk(30, level, imu))


def test_the_imu_of_a_livox_lidar_is_refused(says):
    rig = Go2()

    def imu(stamp, yaw, tilt):
        message = rig.make.imu(stamp, yaw, tilt, "livox_frame")
        message.orientation_covariance[0] = -1.0
        return message

    with says.warns():
        rig.walk(30, level, imu)


def test_an_imu_on_another_clock_does_not_count(says):
    rig = Go2()

    def imu(stamp, yaw, tilt):
        return rig.make.imu(stamp - 60 * SECOND, yaw, tilt, "body")

    with says.warns():
        rig.walk(30, level, imu)


def test_after_a_jump_of_the_clock_the_orientation_must_come_again():
    rig = Go2()
    assert sees_the_wall_alone(rig.walk(5))
    rig.pass_time(-30.0)
    assert stands(rig.tick(), "the clock jumped backwards")
    assert sees_the_wall_alone(rig.walk(3))


def test_a_cloud_is_first_read_when_odometry_has_named_its_frame():
    """A cloud in camera_init may come before the odometry that says that this is its frame."""
    rig = Go2("camera_init")
    rig.driver.take_scan(rig.make.cloud(rig.now, rig.seen(Tilt(0.0, 0.0)), rig.frame), rig.now)
    assert rig.tick().state is not LiveState.DRIVING
    assert sees_the_wall_alone(rig.walk(5))
    assert rig.driver.mounted_by == "the pose"


def test_a_go2_has_its_own_lidar():
    rig = Go2()
    step = rig.walk(5)
    scan = step.observation.scan
    assert (len(scan.ranges), scan.range_min, scan.range_max) == (360, 0.1, 20.0)
    assert step.observation.twist == pytest.approx((0.3, 0.2), abs=0.01)
