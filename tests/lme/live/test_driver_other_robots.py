"""The live driver on other robots: the same drive, seen by other lidars and other sources of poses."""

import math
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.live.config import LiveConfig, ScanConfig
from lme.live.driver import LiveDriver
from lme.live.messages import LASER_SCAN, ODOMETRY, POINT_CLOUD
from lme.live.step import LiveState
from lme.navigation.navigator import Navigator
from lme.perception.scan_points import obstacle_points
from lme.types import Guidance, Pose, Twist
from runners.recordings.bags import Bag
from tests import builders
from tests.made_bags import MOUNT, OTHERS, SECOND, TF, BagMaker, drive
from tests.places import SHARED

BAGS = SHARED / "bags"
OLD_TF = "tf/msg/tfMessage"


class Bold:
    """Guide and planner that creep ahead."""

    def reset(self, rng):
        pass

    def guide(self, observation):
        return Guidance(observation.target)

    def plan(self, observation, guidance):
        return Twist(0.05, 0.0)


def feed(maker, scan=None, **config):
    """The driver, and its steps once a control period, while the messages come as they were recorded."""
    driver = LiveDriver(
        lambda robot: Navigator(Bold(), Bold()),
        builders.shipped("turtlebot2"),
        LiveConfig(soft_stop=False, **config),
        scan,
        wall=lambda: 0,
    )
    steps, due = [], None
    for recorded, topic, kind, message in sorted(maker.messages, key=lambda one: one[0]):
        if due is None:
            driver.set_goal((6.0, -1.5), "", recorded)
            due = recorded + SECOND // 20
        if recorded > due:
            steps.append(driver.tick(due))
            due += SECOND // 5
        if kind in (TF, OLD_TF):
            driver.take_transforms(message, recorded, static=topic == "/tf_static")
        elif kind in (LASER_SCAN, POINT_CLOUD):
            driver.take_scan(message, recorded)
        elif topic != "/cmd_vel":
            driver.take_odometry(message, recorded)
    return driver, steps


def seen(driver, steps):
    """Poses, twists and least distances (T, 3), (T, 2), (T,) of the steps that drive."""
    driving = [step.observation for step in steps[1:]]
    assert {step.state for step in steps[1:]} == {LiveState.DRIVING}, {step.reason for step in steps}
    nearest = [
        np.linalg.norm(obstacle_points(view.scan, driver.robot.lidar.mount), axis=1).min() for view in driving
    ]
    return np.array([v.odometry for v in driving]), np.array([v.twist for v in driving]), np.array(nearest)


def assert_alike(one, other, atol=0.02):
    (poses, twists, nearest), (same_poses, same_twists, same_nearest) = one, other
    np.testing.assert_allclose(poses, same_poses, atol=1e-9)
    np.testing.assert_allclose(twists[2:, 0], same_twists[2:, 0], atol=5e-3)
    np.testing.assert_allclose(twists[2:, 1], same_twists[2:, 1], atol=0.08)
    np.testing.assert_allclose(nearest, same_nearest, atol=atol)


@pytest.fixture(scope="module")
def plain():
    return seen(*feed(drive()))


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_two_lidars_on_the_same_way_see_the_same_obstacles(plain, other):
    driver, steps = feed(drive(**other))
    assert driver.mounted_by == "tf"
    assert_alike(seen(driver, steps), plain)


def test_a_cloud_is_flattened(plain):
    driver, steps = feed(drive(scans="cloud"))
    assert_alike(seen(driver, steps), plain)


def test_the_robots_own_lidar_where_it_is_asked_for(plain):
    driver, steps = feed(drive(), ScanConfig(lidar="robot"))
    assert driver.robot.lidar == builders.shipped("turtlebot2").lidar
    assert_alike(seen(driver, steps), plain)


def test_a_mount_that_is_given_and_one_that_is_not(plain):
    def untold():
        maker = drive()
        maker.messages = [one for one in maker.messages if one[1] != "/tf_static"]
        return maker

    driver, steps = feed(untold(), ScanConfig(mount=[MOUNT.x, MOUNT.y, 0.2, 0.0, 0.0, 0.0]))
    assert driver.mounted_by == "scan.mount"
    assert_alike(seen(driver, steps), plain)
    driver, _ = feed(untold())
    assert driver.mounted_by == "robot=turtlebot2"


def test_tf_that_comes_after_the_first_scan_counts(plain):
    maker = drive()
    late = [m if m[1] != "/tf_static" else (m[0] + SECOND, *m[1:]) for m in maker.messages]
    maker.messages = late
    driver, steps = feed(maker)
    assert driver.mounted_by == "tf"
    tail = [part[6:] for part in seen(driver, steps[:1] + steps[7:])]
    np.testing.assert_allclose(tail[2], plain[2][-len(tail[2]) :], atol=0.02)


def test_messages_with_the_names_of_rospy_are_read(plain):
    """rospy's stamps have other names of fields, and its frames may begin with a slash."""

    class Stamp:
        def __init__(self, stamp):
            self.secs, self.nsecs = stamp.sec, stamp.nanosec

    maker = drive()
    for _, _, kind, message in maker.messages:
        if hasattr(message, "header"):
            message.header.stamp = Stamp(message.header.stamp)
            message.header.frame_id = f"/{message.header.frame_id}"
        if kind == TF:
            for one in message.transforms:
                one.header.stamp = Stamp(one.header.stamp)
                one.child_frame_id = f"/{one.child_frame_id}"
    assert_alike(seen(*feed(maker)), plain, atol=1e-9)


def test_a_robot_with_a_clock_of_its_own_is_driven(plain, says):
    """The robot's computer is eight days behind."""
    maker = drive(stamps=lambda stamp: stamp - 8 * 86_400 * SECOND)
    _, steps = feed(maker)
    assert {step.state for step in steps} == {LiveState.STOPPED}
    says(steps[-1].reason)
    assert_alike(seen(*feed(maker, clock="received")), plain)


def test_a_lidar_that_changes_its_beams_in_the_middle(plain):
    half, other = drive(), drive(beams=720, first=0.0)
    cut = len(half.messages) // 2
    half.messages[cut:] = other.messages[cut:]
    driver, steps = feed(half)
    assert driver.robot.lidar.num_beams == 360
    assert_alike(seen(driver, steps), plain)


def test_a_scan_that_is_none_at_first(says):
    maker = drive()
    broken = BagMaker().scan(maker.messages[0][0], np.array([1.0]), 0.0, math.nan)
    maker.messages = [m for m in maker.messages if m[1] != "/scan"]
    maker.messages += [(m[0], "/scan", LASER_SCAN, broken) for m in maker.messages if m[1] == "/odom"]
    _, steps = feed(maker, clock="received")
    assert {step.command for step in steps} == {Twist(0.0, 0.0)}
    says(steps[-1].reason)


def test_the_pose_of_the_base_by_tf_over_another_frame(plain):
    """odom → base_footprint → base_link, where only the first moves."""
    maker = drive(poses="tf")
    for _, topic, _, message in maker.messages:
        if topic == "/tf":
            message.transforms[0].child_frame_id = "base_footprint"
    start = maker.messages[0][0]
    maker.add("/tf_static", TF, start, maker.transform(0, "base_footprint", "base_link", Pose(0.0, 0.0, 0.0)))
    driver, steps = feed(maker)
    assert driver.frames == ("odom", "base_footprint")
    assert_alike(seen(driver, steps), plain)


@pytest.mark.skipif(not BAGS.is_dir(), reason="the shared recordings are not here")
@pytest.mark.parametrize("path", sorted(BAGS.glob("*.bag")), ids=lambda p: p.stem)
def test_the_messages_of_a_real_robot(path):
    """Its clock is a week behind that of the recording."""
    maker = SimpleNamespace()
    with Bag(path) as bag:
        topics = {topic.name for topic in bag.topics() if {*topic.types} & {LASER_SCAN, ODOMETRY, TF, OLD_TF}}
        maker.messages = [(m.recorded, m.topic, m.type, m.content) for m in bag.messages(topics)]
    driver, steps = feed(maker, clock="received")
    assert driver.mounted_by == "tf"
    assert driver.robot.lidar.num_beams == 726
    states = Counter(step.state for step in steps)
    assert states[LiveState.DRIVING] > 300
    stood = {step.reason.partition(" is older")[0] for step in steps if step.state is not LiveState.DRIVING}
    assert stood <= {"no scan", "guide and planner were being prepared", "the scan", "the odometry"}
