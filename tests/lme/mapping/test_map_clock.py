"""A map's own clock, on hand-worked drives of a robot that sees a different scan at every step."""

import math

import numpy as np
import pytest

from lme.mapping.map_clock import MapClock, MapInput
from lme.types import LaserScan, Limits, Observation, Pose, Twist
from tests.tolerances import KERNEL

DT = 0.05


class FixedPhase:
    """A generator whose stream gives this share of the map's period as phase."""

    def __init__(self, share):
        self.share = share

    def spawn(self, _):
        return [self]

    def uniform(self):
        return self.share


def scan(k):
    return LaserScan(np.array([k], np.float32), 0.0, 0.1, 0.0, 9.0)


def seen(k, speed=1.0, scan_pose=None):
    """At step k of a robot that drives ahead; the only range of its scan is k."""
    pose = Pose(k * speed * DT, 0.0, 0.0)
    limits = Limits(2.0, 2.0, 2.0, 2.0)
    return Observation(scan(k), np.zeros(2), Twist(speed, 0.0), limits, pose, scan_pose=scan_pose)


def inputs(rate, phase, count=5, **motion):
    """(number of the scan, x of its pose, x of the map's pose) [m] of each step; None without a rebuild."""
    clock = MapClock(rate, DT)
    clock.reset(FixedPhase(phase))
    found = [clock.due(seen(k, **motion)) for k in range(count)]
    return [s and (int(s.scan.ranges[0]), s.scan_pose.x, s.pose.x) for s in found]


def test_without_a_rate_every_observation_is_taken_as_it_is():
    clock = MapClock(None, DT)
    clock.reset(np.random.default_rng(0))
    for k in range(3):
        one = seen(k, scan_pose=Pose(-1.0, 0.0, 0.0))
        assert clock.due(one) == MapInput(one.scan, one.odometry, one.odometry)


def test_without_a_rate_no_random_number_is_drawn():
    rng, untouched = np.random.default_rng(3), np.random.default_rng(3)
    MapClock(None, DT).reset(rng)
    assert rng.bit_generator.seed_seq.n_children_spawned == 0
    assert rng.random() == untouched.random()


def test_a_rate_draws_its_phase_from_a_stream_of_its_own():
    phases = []
    for seed in (1, 1, 2):
        rng, untouched = np.random.default_rng(seed), np.random.default_rng(seed)
        clock = MapClock(10.0, DT)
        clock.reset(rng)
        clock.due(seen(0))
        phases.append([getattr(clock.due(seen(k)), "pose", None) for k in range(1, 4)])
        assert rng.random() == untouched.random()
    assert phases[0] == phases[1] != phases[2]


def test_a_map_at_the_rate_of_control_is_rebuilt_between_two_steps_from_the_earlier_scan():
    # 20 Hz, a phase of 0.4 · 0.05 s = 0.02 s: at 0.02, 0.07, 0.12 … s, where a robot at 1 m/s is at 0.02, 0.07, 0.12 m
    expected = [(0, 0.0, 0.0), (0, 0.0, 0.02), (1, 0.05, 0.07), (2, 0.1, 0.12), (3, 0.15, 0.17)]
    for found, (number, scanned, at) in zip(inputs(20.0, 0.4), expected, strict=True):
        assert found[0] == number
        assert found[1:] == pytest.approx((scanned, at), abs=KERNEL)


def test_a_slower_map_skips_steps_and_a_faster_one_keeps_its_last_time():
    # 10 Hz, a phase of 0.7 · 0.1 s: at 0.07, 0.17 s, so between steps 1 and 2, and 3 and 4
    slow = inputs(10.0, 0.7)
    assert [found and found[0] for found in slow] == [0, None, 1, None, 3]
    assert [found[2] for found in slow if found] == pytest.approx([0.0, 0.07, 0.17], abs=KERNEL)
    # 40 Hz, a phase of 0.4 · 0.025 s: twice a step, the last time 0.035 s after it
    assert [found[2] for found in inputs(40.0, 0.4)[1:]] == pytest.approx(
        [0.035, 0.085, 0.135, 0.185], abs=KERNEL
    )


def test_a_scan_is_projected_from_where_it_was_taken():
    taken = Pose(-0.02, 0.1, 0.3)
    clock = MapClock(20.0, DT)
    clock.reset(FixedPhase(0.5))
    assert clock.due(seen(0, scan_pose=taken)).scan_pose == taken
    assert clock.due(seen(1)).scan_pose == taken  # of the earlier step


def test_the_pose_in_between_turns_the_shorter_way():
    clock = MapClock(20.0, DT)
    clock.reset(FixedPhase(0.5))
    clock.due(seen(0)._replace(odometry=Pose(0.0, 0.0, 3.0)))
    found = clock.due(seen(0)._replace(odometry=Pose(0.0, 0.0, -3.0)))
    assert abs(found.pose.yaw) == pytest.approx(math.pi, abs=KERNEL)


def test_a_new_episode_forgets_the_last_observation():
    clock = MapClock(20.0, DT)
    clock.reset(FixedPhase(0.5))
    clock.due(seen(7))
    clock.reset(FixedPhase(0.5))
    assert clock.due(seen(2)).scan.ranges[0] == 2
