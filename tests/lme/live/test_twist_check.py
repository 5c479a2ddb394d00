"""Twists that contradict the slope of the poses are found, and no others."""

import math

import numpy as np
import pytest

from lme.geometry.frames import compose
from lme.live.twist_check import TwistCheck
from lme.types import Pose, Twist

SECOND = 1_000_000_000


def drive(seconds=8.0, rate=20.0, v=0.5, omega=lambda t: 0.4 * math.sin(t), lateral=0.0, yaw=0.3):
    """(time [s], pose, twist) of a drive."""
    pose = Pose(0.0, 0.0, yaw)
    for k in range(int(seconds * rate)):
        turn = omega(k / rate)
        yield k / rate, pose, Twist(v, turn)
        pose = compose(pose, Pose(v / rate, lateral / rate, turn / rate))


def contradiction(samples, said=lambda pose, v, omega: (v, omega), at_end=False):
    check = TwistCheck()
    for seconds, pose, twist in samples:
        check.add(round(seconds * SECOND), pose, Twist(*said(pose, *twist)))
    return check.contradiction(at_end)


WRONG = {
    "in the odometry frame": lambda pose, v, omega: (v * math.cos(pose.yaw), omega),
    "never set": lambda *_: (0.0, 0.0),
    "speed never set": lambda pose, v, omega: (0.0, omega),
    "in mm/s": lambda pose, v, omega: (1000 * v, omega),
    "in deg/s": lambda pose, v, omega: (v, math.degrees(omega)),
    "the other way round": lambda pose, v, omega: (v, -omega),
    "backwards": lambda pose, v, omega: (-v, omega),
    "not a number": lambda pose, v, omega: (math.nan, omega),
}


@pytest.mark.parametrize("said", WRONG.values(), ids=WRONG)
def test_a_twist_that_means_something_else_is_found(said):
    path = drive(omega=lambda t: 0.5, yaw=math.pi / 4)
    if "odometry" in next(name for name, other in WRONG.items() if other is said):
        path = drive(omega=lambda t: 0.0, yaw=math.pi / 4)  # on a diagonal
    found = contradiction(path, said)
    assert ("always zero" if said is WRONG["never set"] else "contradict") in found
    assert "\n" not in found


def test_a_drive_may_turn_before_its_twists_are_wrong():
    """Along the x axis of the odometry frame both frames are the same."""
    path = [*drive(omega=lambda t: 0.0 if t < 8 else (0.5 if t < 11 else 0.0), seconds=18, yaw=0.0)]
    assert contradiction(path[:160], WRONG["in the odometry frame"]) is None
    assert contradiction(path, WRONG["in the odometry frame"])


@pytest.mark.parametrize("rate", [5.0, 10.0, 200.0])
def test_twists_that_are_all_zero_are_found_after_a_second_of_motion(rate, says):
    """FAST-LIO never sets its twist. The robot stands first, which says nothing."""
    stands = [*drive(seconds=3.0, rate=rate, v=0.0, omega=lambda t: 0.0)]
    moves = [(t + 3.0, pose, twist) for t, pose, twist in drive(seconds=2.0, rate=rate, v=0.3)]
    assert contradiction(stands, WRONG["never set"], at_end=True) is None
    found = contradiction([*stands, *moves], WRONG["never set"])
    says(found)
    assert "topics.twist=poses" in found


@pytest.mark.parametrize("at", range(10, 20))
@pytest.mark.parametrize("rate", [2.0, 10.0])
def test_a_pose_that_jumps_while_the_robot_stands_is_no_motion(rate, at):
    """At a loop closure it jumps for good, at a wrong pose out and back."""
    still = [*drive(seconds=15.0, rate=rate, v=0.0, omega=lambda t: 0.0)]
    away = Pose(2.0, 0.0, 0.3)
    for_good = [(t, compose(away, p) if k >= at else p, twist) for k, (t, p, twist) in enumerate(still)]
    out_and_back = [(t, compose(away, p) if k == at else p, twist) for k, (t, p, twist) in enumerate(still)]
    for path in (for_good, out_and_back):
        check = TwistCheck()
        for seconds, pose, twist in path:
            check.add(round(seconds * SECOND), pose, twist)
            assert check.contradiction() is None


def test_one_twist_that_is_not_zero_shows_that_they_are_set():
    path = [(t, pose, Twist(0.01 if t < 0.2 else 0.0, 0.0)) for t, pose, _ in drive(seconds=3.0)]
    assert contradiction(path) is None


def test_a_short_drive_counts_at_its_end():
    path = [*drive(seconds=2.5)]
    assert contradiction(path, WRONG["speed never set"]) is None
    assert "0.00 m/s" in contradiction(path, WRONG["speed never set"], at_end=True)
    assert contradiction(path, at_end=True) is None


@pytest.mark.parametrize("rate", [5.0, 20.0, 200.0])
@pytest.mark.parametrize("seed", range(5))
def test_noise_ripple_and_lag_are_no_contradiction(rate, seed):
    """A walking robot whose body sways, poses to a centimetre, twists that come from a filter."""
    random, said = np.random.default_rng(seed), []
    for t, pose, twist in drive(rate=rate, seconds=20.0, omega=lambda t: 0.8 * math.sin(2 * t)):
        sway = Pose(0.02 * math.sin(12 * t), 0.03 * math.sin(12 * t), 0.05 * math.sin(12 * t))
        noisy = compose(pose, Pose(*(np.array(sway) + random.normal(0.0, (0.01, 0.01, 0.005)))))
        ripple = 0.15 * math.sin(12 * t + 1.0) + random.normal(0.0, 0.05)
        said.append((t, noisy, Twist(1.08 * twist.v + ripple, twist.omega + random.normal(0.0, 0.1))))
    assert contradiction(said, at_end=True) is None


def test_a_robot_that_moves_sideways_is_no_contradiction():
    assert contradiction(drive(v=0.0, lateral=0.6), at_end=True) is None
    assert contradiction(drive(v=0.3, lateral=0.6), at_end=True) is None


def test_resets_loop_closures_and_gaps_are_no_contradiction():
    def jumped(every):
        for k, (t, pose, twist) in enumerate(drive(seconds=60.0)):
            jumps = k // every
            yield t + 3.0 * jumps, compose(Pose(0.7 * jumps, -0.4 * jumps, 0.2 * jumps), pose), twist

    assert contradiction(jumped(100)) is None
    reset = [*drive(seconds=5.0), *((t + 5.0, *rest) for t, *rest in drive(seconds=5.0))]
    assert contradiction(reset, at_end=True) is None


def test_a_robot_that_stands_says_nothing():
    assert contradiction(drive(v=0.0, omega=lambda t: 0.0, seconds=30.0), at_end=True) is None
    drift = [(t, Pose(0.01 * t, 0.0, 0.001 * t), Twist(0.0, 0.0)) for t in np.arange(0.0, 60.0, 0.1)]
    assert contradiction(drift, at_end=True) is None
