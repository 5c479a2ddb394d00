"""Where the robot was at any instant."""

import math

import pytest

from lme.live.poses import Track
from lme.types import Pose, Twist

SECOND = 1_000_000_000
STALE = SECOND // 2


def track(*samples):
    made = Track()
    for stamp, pose, twist in samples:
        made.add(stamp, Pose(*pose), None if twist is None else Twist(*twist))
    return made


def test_between_two_poses_the_motion_is_interpolated_the_short_way_round():
    made = track((0, (0, 0, 3.0), (1, 0)), (SECOND // 4, (1, 2, -3.0), (3, 1)))
    motion = made.at(SECOND // 8, STALE)
    assert motion.pose[:2] == (0.5, 1.0)
    assert abs(motion.pose.yaw) == pytest.approx(math.pi)
    assert motion.twist == Twist(2.0, 0.5)


def test_at_a_recorded_stamp_nothing_is_changed():
    pose, twist = Pose(0.1 + 0.2, 1 / 3, 0.7), Twist(1 / 7, -1 / 9)
    made = track((0, (0, 0, 0), (0, 0)), (7, pose, twist), (11, (1, 1, 1), (1, 1)))
    assert made.at(7, STALE) == (7, pose, twist)


def test_a_pose_from_long_ago_does_not_count():
    made = track((0, (0, 0, 0), (0, 0)), (10 * SECOND, (1, 0, 0), (0, 0)))
    assert made.at(4 * SECOND, STALE) is None
    assert made.at(10 * SECOND + STALE, STALE).pose.x == 1
    assert made.at(10 * SECOND + STALE + 1, STALE) is None
    assert made.at(-STALE - 1, STALE) is None
    assert Track().at(0, STALE) is None


def test_without_a_twist_speed_is_the_slope_of_the_poses():
    turning = [(k * SECOND // 10, (0.0, 0.0, 0.04 * k), None) for k in range(20)]
    assert track(*turning).at(15 * SECOND // 10, STALE).twist == pytest.approx((0.0, 0.4))
    driving = [(k * SECOND // 10, (-0.05 * k, 0.0, math.pi), None) for k in range(20)]
    assert track(*driving).at(15 * SECOND // 10, STALE).twist == pytest.approx((0.5, 0.0))
    assert track((0, (0, 0, 0), None)).at(0, STALE).twist == (0, 0)


def test_a_pose_that_comes_late_is_left_out():
    made = track((5 * SECOND, (0, 0, 0), (0, 0)), (4 * SECOND, (9, 9, 9), (0, 0)))
    assert made.at(5 * SECOND, STALE).pose == made.at(5 * SECOND - STALE, STALE).pose == Pose(0, 0, 0)


def test_a_long_drive_is_not_kept():
    made = Track()
    for k in range(20_000):
        made.add(k * SECOND // 100, Pose(k, 0, 0), Twist(0, 0))
    assert made.at(0, SECOND) is None
    assert made.at(19_999 * SECOND // 100, STALE).pose.x == 19_999
