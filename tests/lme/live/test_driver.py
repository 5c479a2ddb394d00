"""Safety of the live driver: whatever comes or does not come, the robot drives only when it may."""

import math
import random
import threading
import time
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.errors import InputError
from lme.live.config import LiveConfig
from lme.live.driver import LiveDriver
from lme.live.frames import FramesConfig
from lme.live.step import LiveState
from lme.navigator import Navigator
from lme.types import Guidance, Pose, Twist
from tests import builders
from tests.live_loop import BEGAN
from tests.made_bags import SECOND, BagMaker

CRUISE = Twist(0.3, 0.1)
PERIOD = SECOND // 5
FAR = (10.0, 0.0)


class Puppet:
    """Guide and planner in one. Its command is given; it notes what it sees and how often it starts anew."""

    def __init__(self):
        self.command, self.seen, self.resets = CRUISE, [], 0

    def reset(self, rng):
        self.resets += 1

    def guide(self, observation):
        return Guidance(observation.target)

    def plan(self, observation, guidance):
        self.seen.append(observation)
        if isinstance(self.command, Exception):
            raise self.command
        return self.command() if callable(self.command) else self.command


class Rig:
    """A driver, the clock, and a robot that stands at the origin of odom with walls 3 m away."""

    def __init__(self, frames=None, robot=None, **config):
        self.puppet, self.make = Puppet(), BagMaker()
        self.now, self.wall = BEGAN, 0
        self.robot = robot or builders.stage()
        self.driver = LiveDriver(
            lambda robot: Navigator(self.puppet, self.puppet),
            self.robot,
            LiveConfig(**config),
            frames=frames,
            wall=lambda: self.wall,
        )

    def scan(self, stamp=None, ranges=None):
        ranges = np.full(540, 3.0) if ranges is None else ranges
        stamp = self.now if stamp is None else stamp
        increment = 2 * math.pi / max(len(ranges), 1)
        self.driver.take_scan(self.make.scan(stamp, ranges, -math.pi, increment, (0.02, 15.0)), self.now)

    def odometry(self, stamp=None, pose=Pose(0.0, 0.0, 0.0), v=0.0, omega=0.0):  # noqa: B008 - immutable
        stamp = self.now if stamp is None else stamp
        self.driver.take_odometry(self.make.odometry(stamp, pose, v, omega), self.now)

    def transform(self, frame, child, pose=Pose(0.0, 0.0, 0.0), static=False):  # noqa: B008 - immutable
        self.driver.take_transforms(
            self.make.transform(self.now, frame, child, pose), self.now, static=static
        )

    def pass_time(self, seconds=0.2):
        self.now += round(seconds * SECOND)
        self.wall += round(seconds * SECOND)

    def tick(self):
        return self.driver.tick(self.now)

    def sense(self):
        self.odometry()
        self.scan()

    def period(self):
        """One control period with fresh data."""
        self.pass_time()
        self.sense()
        return self.tick()

    def drive(self):
        """Set off."""
        self.sense()
        self.tick()  # prepares
        self.driver.set_goal(FAR, "odom", self.now)
        return self.period()


@pytest.fixture
def rig():
    return Rig()


def stands(step, reason, state=LiveState.STOPPED):
    assert step.command == Twist(0.0, 0.0)
    assert reason in step.reason, step.reason
    assert step.state is state
    return True


def drives(step):
    assert step.state is LiveState.DRIVING, step.reason
    assert step.reason == ""
    assert step.command.v > 0.0
    return True


def test_it_drives(rig):
    step = rig.drive()
    assert drives(step)
    assert step.goal == 1
    np.testing.assert_allclose(step.observation.target, FAR)
    assert step.observation.limits == rig.robot.limits
    assert step.wanted == CRUISE


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


def test_without_a_goal_it_stands(rig):
    assert stands(rig.tick(), "no goal", LiveState.IDLE)
    assert "prepared" in rig.period().reason
    assert stands(rig.period(), "no goal", LiveState.IDLE)


# Scans


def test_without_a_scan_it_stands(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.odometry()
    assert stands(rig.tick(), "no scan")


def test_a_stale_scan_stops_it_until_there_is_a_fresh_one(rig):
    rig.drive()
    for _ in range(2):
        rig.pass_time()
        rig.odometry()
        assert drives(rig.tick())
    rig.pass_time()
    rig.odometry()
    assert stands(rig.tick(), "the scan is older than 0.5 s")
    assert drives(rig.period())


@pytest.mark.parametrize(
    "ranges", [[math.nan] * 540, [0.0] * 540, [0.01] * 540], ids=["NaN", "0", "too near"]
)
def test_an_empty_scan_stops_it(rig, ranges):
    rig.drive()
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.array(ranges))
    assert stands(rig.tick(), "the scan is empty")
    assert drives(rig.period())


@pytest.mark.parametrize(
    "points", [np.empty((0, 3)), np.full((50, 3), math.nan), np.zeros((50, 3))], ids=["none", "NaN", "0"]
)
def test_an_empty_cloud_stops_it(rig, points):
    def see(points):
        rig.pass_time()
        rig.odometry()
        rig.driver.take_scan(rig.make.cloud(rig.now, points), rig.now)
        return rig.tick()

    wall = np.column_stack((np.full(50, 3.0), np.linspace(-1.0, 1.0, 50), np.full(50, 0.2)))
    see(wall)
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert drives(see(wall))
    assert stands(see(points), "the scan is empty")
    floor = wall * [1.0, 1.0, 0.0]
    assert drives(see(floor))  # all that is seen is below the heights that count


def test_in_the_open_it_drives(rig):
    """A beam that meets nothing within range measures something: that nothing is there."""
    rig.drive()
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.full(540, math.inf))
    assert drives(rig.tick())


def test_scans_out_of_order_and_late_ones_do_not_count(rig):
    rig.drive()
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.full(540, 2.0))
    rig.scan(stamp=rig.now - SECOND // 10, ranges=np.full(540, 1.0))
    assert rig.tick().observation.scan.ranges[0] == 2.0
    for _ in range(3):
        rig.pass_time()
        rig.odometry()
        rig.scan(stamp=rig.now - SECOND)
        step = rig.tick()
    assert stands(step, "the scan is older than 0.5 s (its stamp is 1.0 s behind the clock")


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


# Poses


def test_without_odometry_it_stands(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.scan()
    rig.tick()
    assert stands(rig.tick(), "no odometry")


def test_stale_odometry_stops_it(rig):
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


def test_a_transform_of_the_robot_that_is_not_a_number_is_said(rig):
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.transform("odom", "base_link", Pose(math.nan, 0.0, 0.0))
    rig.scan()
    rig.tick()
    assert stands(rig.tick(), "no odometry (the transform of base_link is not finite)")


def test_once_odometry_has_come_tf_is_no_substitute(rig):
    rig.drive()
    for _ in range(3):
        rig.pass_time()
        rig.transform("odom", "base_link")
        rig.scan()
        step = rig.tick()
    assert stands(step, "the odometry is older than 0.5 s")


# The goal


def test_at_the_goal_it_stands_until_there_is_another(rig):
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


@pytest.mark.parametrize("command", ["new goal", "cancel", "stop"])
def test_what_happens_during_a_decision_stops_it(rig, command):
    rig.drive()

    def meanwhile():
        if command == "new goal":
            rig.driver.set_goal((0.0, 7.0), "", rig.now)
        elif command == "cancel":
            rig.driver.cancel()
        else:
            rig.driver.stop("shutdown")
        return CRUISE

    rig.puppet.command = meanwhile
    step = rig.period()
    assert step.command == Twist(0.0, 0.0)
    assert step.state is (LiveState.CANCELLED if command == "cancel" else LiveState.STOPPED)


@pytest.mark.parametrize("goal", [(math.nan, 0.0), (1.0,), (1.0, math.inf)])
def test_a_goal_that_is_no_position(rig, goal):
    with pytest.raises(InputError, match="must be two finite numbers") as error:
        rig.driver.set_goal(goal, "odom", rig.now)
    assert "\n" not in str(error.value)


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


def test_the_latest_motion_comes_with_every_step(rig):
    assert rig.tick().motion is None
    rig.drive()
    rig.pass_time()
    rig.scan()
    rig.odometry(pose=Pose(9.9, 0.0, 0.0), v=0.3)
    step = rig.tick()
    assert step.state is LiveState.ARRIVED
    assert step.motion == (rig.now, Pose(9.9, 0.0, 0.0), Twist(0.3, 0.0))


# The clock


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


def test_a_clock_that_stands_still_stops_it_by_wall_time(rig):
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


# Guide and planner


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (Twist(math.nan, 0.0), "InputError: Puppet.plan returned Twist(v=nan, omega=0.0)"),
        (Twist(0.0, math.inf), "both finite"),
        (None, "both finite"),
        (ZeroDivisionError("no"), "ZeroDivisionError: no"),
    ],
)
def test_a_planner_that_fails_stops_it(rig, command, reason):
    rig.drive()
    rig.puppet.command = command
    assert stands(rig.period(), reason)
    rig.puppet.command = CRUISE
    assert drives(rig.period())


def test_a_decision_that_takes_too_long_does_not_count(rig):
    rig.drive()

    def slow():
        rig.wall += round(0.6 * SECOND)
        return CRUISE

    rig.puppet.command = slow
    assert stands(rig.period(), "the decision took 0.60 s")


def test_a_navigator_that_cannot_be_built_is_said():
    rig = Rig()
    rig.driver._make_navigator = lambda robot: builders.Simple(None, None)
    rig.sense()
    assert stands(rig.tick(), "AttributeError")


def test_after_shutdown_it_stands_for_good(rig):
    rig.drive()
    assert stands(rig.driver.stop("shutdown"), "shutdown")
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(rig.period(), "shutdown")


# Commands


def test_commands_are_within_the_limits(rig):
    rig.puppet.command = Twist(9.0, -9.0)
    steps = [rig.drive(), *(rig.period() for _ in range(5))]
    np.testing.assert_allclose(
        [step.command for step in steps],
        [(0.4, -0.4), (0.5, -0.8), (0.5, -1.2), *[(0.5, -math.pi / 2)] * 3],
    )
    assert steps[0].wanted == (9.0, -9.0)


def test_after_a_stop_it_starts_from_rest(rig):
    rig.puppet.command = Twist(0.5, 0.0)
    rig.drive()
    assert rig.period().command.v == 0.5
    rig.pass_time(0.8)
    rig.tick()
    assert rig.period().command.v == pytest.approx(0.4)


# Messages that are none


def test_garbage_is_as_if_nothing_came(rig):
    rig.drive()
    for _ in range(3):
        rig.pass_time()
        rig.odometry()
        rig.driver.take_scan(SimpleNamespace(data=b"?"), rig.now)
        rig.driver.take_odometry(SimpleNamespace(pose=7), rig.now)
        rig.driver.take_transforms(SimpleNamespace(transforms=[None]), rig.now)
        step = rig.tick()
    assert stands(step, "the scan is older than 0.5 s (AttributeError")
    assert drives(rig.period())


def test_a_transform_that_is_not_a_number_is_left_out(rig):
    rig.transform("base_link", "laser", static=True)
    rig.transform("base_link", "laser", Pose(math.nan, 0.0, 0.0), static=True)
    rig.drive()
    assert drives(rig.period())


@pytest.mark.parametrize("seed", range(5))
def test_no_message_makes_it_raise_or_drive_blindly(seed):
    """Random messages, times and goals: a step always comes, and motion needs a scan and a pose of the last 0.5 s."""
    rig, random_ = Rig(), random.Random(seed)
    scans, poses, drove = [], [], 0
    odd = (0.0, 1.0, -1.0, math.nan, math.inf, 1e30)
    for _ in range(1000):
        rig.pass_time(random_.choice((0.0, 0.05, 0.2, 0.2, 0.3)))
        if random_.random() < 0.02:
            rig.now += random_.choice((-3, 3)) * SECOND
        stamp = rig.now + random_.choice((0, 0, 0, -SECOND // 10, SECOND, -2 * SECOND))
        match random_.randrange(6):
            case 0 | 1:
                beams = random_.choice((0, 1, 540))
                rig.scan(stamp, np.array([random_.choice((*odd, 3.0, 5.0)) for _ in range(beams)]))
                scans.append(stamp)
            case 2 | 3:
                x, y, v = random_.choices((0.0, 0.1, 0.2, 0.3, *odd), k=3)
                rig.odometry(stamp, Pose(x, y, random_.choice((0.0, 3.0, math.nan))), v)
                poses.append(stamp)
            case 4:
                rig.driver.set_goal((5.0, 1.0), random_.choice(("odom", "", "base_link", "map")), rig.now)
            case 5:
                pair = random_.sample(("map", "odom", "base_link", "laser"), 2)
                rig.transform(*pair, static=random_.random() < 0.5)
        step = rig.tick()
        assert all(map(math.isfinite, step.command))
        assert abs(step.command.v) <= rig.robot.v_max
        if step.command != (0.0, 0.0) and step.stamp == rig.now:
            drove += 1
            assert any(abs(rig.now - stamp) <= SECOND // 2 for stamp in scans)
            assert any(abs(rig.now - stamp) <= SECOND // 2 for stamp in poses)
    assert drove > 10


def test_messages_goals_and_ticks_may_come_from_several_threads():
    rig, states, began = Rig(), Counter(), time.monotonic_ns()
    driver, make = rig.driver, rig.make

    def clock():
        return BEGAN + time.monotonic_ns() - began

    def repeat(send):
        for _ in range(100):
            now = clock()
            send(now)
            time.sleep(0.002)

    ranges = np.full(540, 3.0)
    senders = [
        lambda now: driver.take_scan(make.scan(now, ranges, -math.pi, math.tau / 540, (0.02, 15.0)), now),
        lambda now: driver.take_odometry(make.odometry(now, Pose(0.0, 0.0, 0.0), 0.0, 0.0), now),
        lambda now: driver.take_transforms(make.transform(now, "map", "odom", Pose(0.0, 0.0, 0.0)), now),
        lambda now: driver.set_goal((8.0, now % 2), "map", now),
        lambda now: driver.cancel() if now % 7 == 0 else None,
    ]
    threads = [threading.Thread(target=repeat, args=(send,)) for send in senders]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        states[driver.tick(clock()).state] += 1
    for thread in threads:
        thread.join()
    assert states[LiveState.DRIVING] > 10
    assert "Error" not in driver.tick(clock()).reason


def test_names_of_frames_that_are_given(rig):
    rig = Rig(frames=FramesConfig("/world", "robot"))
    rig.drive()
    assert rig.driver.frames == ("world", "robot")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("stale", 0.0, "live.stale is 0: must be greater than 0"),
        ("clock", "sundial", "live.clock is 'sundial': must be one of header, received"),
        ("seed", -1, "live.seed is -1"),
    ],
)
def test_a_mistake_in_the_config_is_one_line(key, value, message):
    with pytest.raises(InputError, match=message) as error:
        LiveConfig(**{key: value})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("first", [3, 135], ids=["coarse", "finer"])
def test_a_first_scan_that_is_not_whole_does_not_blind_the_robot(rig, first):
    rig.odometry()
    rig.scan(ranges=np.full(first, 3.0))
    rig.tick()  # prepares for this lidar
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(rig.period(), "being prepared")
    assert rig.driver.robot.lidar.num_beams == 540
    assert drives(rig.period())
    ahead = np.abs(np.linspace(-math.pi, math.pi, 540, endpoint=False)) < 0.5
    rig.pass_time()
    rig.odometry(v=0.3)
    rig.scan(ranges=np.where(ahead, 0.27, 3.0))
    assert stands(rig.tick(), "soft stop")


def test_it_stands_before_guide_and_planner_are_prepared_for_another_lidar(rig):
    rig.odometry()
    rig.scan(ranges=np.full(180, 3.0))
    rig.tick()
    rig.driver.set_goal(FAR, "odom", rig.now)
    rig.pass_time()
    rig.odometry()
    rig.scan(ranges=np.full(180, 3.0))
    assert drives(rig.tick())
    assert stands(rig.period(), "must be prepared")
    assert stands(rig.period(), "being prepared")
    assert drives(rig.period())
