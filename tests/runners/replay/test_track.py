"""Where the robot was at any instant, which transforms join two frames, when a decision is due."""

import math

import numpy as np
import pytest

from lme.errors import InputError
from lme.types import Pose, Twist
from runners.replay import messages
from runners.replay.driver import _Sampler, _Ticks
from runners.replay.report import headings_ahead
from runners.replay.track import Track
from runners.replay.transforms import TransformTree
from tests.runners.replay.made_bags import SECOND, BagMaker

STALE = SECOND // 2


def track(*samples):
    made = Track("/odom")
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
    assert Track("/odom").at(0, STALE) is None


def test_without_a_twist_speed_is_the_slope_of_the_poses():
    turning = [(k * SECOND // 10, (0.0, 0.0, 0.04 * k), None) for k in range(20)]
    assert track(*turning).at(15 * SECOND // 10, STALE).twist == pytest.approx((0.0, 0.4))
    driving = [(k * SECOND // 10, (-0.05 * k, 0.0, math.pi), None) for k in range(20)]
    assert track(*driving).at(15 * SECOND // 10, STALE).twist == pytest.approx((0.5, 0.0))
    assert track((0, (0, 0, 0), None)).at(0, STALE).twist == (0, 0)


def test_time_that_goes_backwards_is_said():
    made = track((5 * SECOND, (0, 0, 0), (0, 0)))
    made.add(5 * SECOND - SECOND // 20, Pose(9, 9, 9), None)  # overtaken by a few milliseconds
    assert made.at(5 * SECOND, STALE).pose == Pose(0, 0, 0)
    with pytest.raises(InputError, match=r"time of /odom goes backwards by 3 s .*clock=recorded") as error:
        made.add(2 * SECOND, Pose(0, 0, 0), None)
    assert "\n" not in str(error.value)


def test_a_long_drive_is_not_kept():
    made = Track("/odom")
    for k in range(20_000):
        made.add(k * SECOND // 100, Pose(k, 0, 0), Twist(0, 0))
    assert len(made._stamps) <= 4096
    assert made.at(19_999 * SECOND // 100, STALE).pose.x == 19_999


# Transforms


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


# Decisions and headings


def due(dt, rate, stamps):
    ticks = _Ticks(dt, rate)
    return [stamp for stamp in stamps if ticks.due(round(stamp * SECOND))]


def test_every_scan_is_a_tick_where_they_come_at_the_robots_rate():
    jittered = [0.1 * k + 0.03 * (k % 3 - 1) for k in range(1, 60)]
    assert due(0.1, 10.0, jittered) == jittered


def test_of_faster_scans_the_one_nearest_to_the_due_time_is_taken():
    scans = [k / 9.9 for k in range(500)]
    taken = due(0.2, 9.9, scans)
    assert abs(len(taken) - 5.0 * scans[-1]) < 3
    assert all(abs(stamp - 0.2 * k) < 0.6 / 9.9 for k, stamp in enumerate(taken))


def test_after_a_gap_ticks_go_on_from_the_next_scan():
    assert due(0.2, 10.0, [0.0, 0.1, 0.2, 5.03, 5.13, 5.23, 5.43]) == [0.0, 0.2, 5.03, 5.23, 5.43]


@pytest.mark.parametrize("number", [1, 59, 120, 1000])
def test_the_sample_is_spread_evenly(number):
    sampler = _Sampler()
    for k in range(number):
        sampler.offer(k)
    gaps = set(np.diff(sampler.kept))
    assert sampler.kept[0] == 0
    assert len(gaps) <= 1
    assert min(number, 60) <= len(sampler.kept) < 120


def test_the_robots_heading_is_where_it_came_to():
    poses = np.array([(x, 0.0, 0.5) for x in np.arange(0.0, 3.01, 0.25)] + [(3.0, 1.0, 0.0)])
    headings = headings_ahead(poses, 1.0)
    np.testing.assert_allclose(headings[:9], -0.5)
    assert headings[12] == pytest.approx(math.pi / 2 - 0.5)
    assert np.isnan(headings[13])
