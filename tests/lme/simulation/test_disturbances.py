"""Delay, slip, noise, lost beams and a goal in the mist: each as strong as asked for, none by default."""

import dataclasses
import math
from functools import partial

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import to_robot
from lme.simulation.disturbances import Disturbances, Measured, PastMotion, slipped
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.types import Pose, Twist
from tests.builders import CLUTTER, room, shipped, stage, task
from tests.tolerances import KERNEL

KINDS = {
    "fast": (FastSimulator, partial(load_settings, "sim/fast")),
    "physics": (PhysicsSimulator, partial(load_settings, "sim/physics")),
}
BOTH = pytest.mark.parametrize("kind", list(KINDS))
KEYS = {
    "latency": 0.05,
    "lag": 0.2,
    "odometry_age": 0.02,
    "natural_frequency_v": 7.0,
    "natural_frequency_omega": 7.0,
    "overshoot_v": 0.5,
    "overshoot_omega": 0.25,
    "ripple_v": 0.07,
    "ripple_omega": 0.25,
    "tilt": 0.3,
    "slip": 0.1,
    "odometry_error": 0.03,
    "scan_noise": 0.02,
    "scan_dropout": 0.2,
    "goal_noise": 0.1,
    "goal_noise_yaw": 0.1,
    "goal_rate": 2.0,
}


def started(kind, world=None, robot=None, seed=0, goal=(1e3, 0.0), **sim):
    """A simulator at the start of a task, and its first observation."""
    simulator_class, config_class = KINDS[kind]
    simulator = simulator_class(config_class(**sim), robot or stage())
    return simulator, simulator.reset(task(world, goal=goal), np.random.default_rng(seed))


LEGS = {"natural_frequency_v": 7.0, "natural_frequency_omega": 7.0}
WITH = {
    "goal_rate": {"goal_noise": 0.1},
    "overshoot_v": LEGS,
    "overshoot_omega": LEGS,
}  # keys that act with others


def seen_on_the_way(kind, steps=8, **sim):
    robot = stage()
    robot.lidar.height = 0.3
    simulator, first = started(kind, CLUTTER, robot, **sim)
    return [first] + [simulator.step(Twist(0.2, 0.3)) for _ in range(steps)]


def test_the_keys_are_all_tried():
    assert set(KEYS) == {field.name for field in dataclasses.fields(Disturbances)}


@BOTH
@pytest.mark.parametrize("key", KEYS)
def test_every_disturbance_acts_and_repeats_with_the_seed(kind, key):
    others = WITH.get(key, {})
    sim = {key: KEYS[key], **others}
    calm, one, again = (seen_on_the_way(kind, **s) for s in (others, sim, sim))
    for a, b in zip(one, again, strict=True):
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
        np.testing.assert_array_equal(a.target, b.target)
        assert a[2:] == b[2:]
    assert any(
        (a.scan.ranges != b.scan.ranges).any() or (a.target != b.target).any() or a.twist != b.twist
        for a, b in zip(calm, one, strict=True)
    )


# --- delay --------------------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize("latency", [0.05, 0.2, 0.47])
def test_a_command_takes_effect_after_its_latency(kind, latency):
    # 0.4 m/s from rest at 2 m/s²: 0.2 s to get there, so 0.04 m less than at once.
    simulator, _ = started(kind, latency=latency)
    for _ in range(5):
        simulator.step(Twist(0.4, 0.0))
    assert simulator.state.pose.x == pytest.approx(0.4 * (1.0 - latency) - 0.04, abs=0.4 * 0.006)


@BOTH
def test_commands_keep_their_order_and_their_length(kind):
    orders = [Twist(0.3, 0.0), Twist(0.0, 1.0), Twist(-0.2, 0.5), *[Twist(0.0, 0.0)] * 4]
    ends = []
    for latency in (0.0, 0.2, 0.4):
        simulator, _ = started(kind, latency=latency)
        for order in orders:
            simulator.step(order)
        ends.append(simulator.state.pose)
    for end in ends[1:]:
        assert end == pytest.approx(ends[0], abs=2e-3)


# --- lag ----------------------------------------------------------------------------------------------


@BOTH
def test_the_velocity_approaches_the_command_with_the_time_constant(kind):
    simulator, _ = started(kind, robot=stage(alpha_v=1e3, alpha_omega=1e3), lag=0.25)
    for k in range(1, 8):
        seen = simulator.step(Twist(0.4, -0.3))
        reached = 1.0 - math.exp(-k * 0.2 / 0.25)
        assert seen.twist == pytest.approx((0.4 * reached, -0.3 * reached), abs=KERNEL)


@BOTH
def test_a_lag_leaves_the_limits_of_acceleration(kind):
    simulator, _ = started(kind, robot=stage(alpha_v=0.5), lag=0.05)
    assert simulator.step(Twist(0.4, 0.0)).twist.v == pytest.approx(0.1, abs=KERNEL)


@BOTH
def test_a_lag_costs_as_much_way_as_the_time_constant(kind):
    ways = []
    for lag in (0.0, 0.3):
        simulator, _ = started(kind, robot=stage(alpha_v=1e3), lag=lag)
        for _ in range(20):
            simulator.step(Twist(0.4, 0.0))
        ways.append(simulator.state.pose.x)
    assert ways[0] - ways[1] == pytest.approx(0.4 * 0.3, abs=0.4 * 0.006)


# --- slip ---------------------------------------------------------------------------------------------


def test_slip_by_hand():
    # Wheels 0.5 m apart, forward 1, turn 2: left 0.5, right 1.5; 10 % more and 20 % less: 0.55 and 1.2.
    assert slipped((1.0, 2.0), (1.1, 0.8), 0.5) == pytest.approx((0.875, 1.3), abs=KERNEL)
    assert slipped((1.0, 2.0), (1.0, 1.0), 0.5) == pytest.approx((1.0, 2.0), abs=KERNEL)


@BOTH
def test_slip_is_as_strong_as_asked_for_and_odometry_does_not_know(kind):
    robot = stage(alpha_v=1e3)
    simulator, _ = started(kind, robot=robot, slip=0.1)
    errors, turns, before = [], [], simulator.state.pose
    for _ in range(300):
        seen = simulator.step(Twist(0.5, 0.0))
        now = simulator.state.pose
        errors.append(math.dist(before[:2], now[:2]) / 0.1 - 1.0)
        turns.append((now.yaw - before.yaw + math.pi) % (2 * math.pi) - math.pi)
        before = now
    # The mean of two wheels: 0.1/√2; their difference over a track of 0.4 m: 0.1 · √2 · 0.1/0.4.
    assert np.std(errors) == pytest.approx(0.0707, rel=0.15)
    assert np.std(turns) == pytest.approx(0.1 * math.sqrt(2) * 0.1 / 0.4, rel=0.15)
    assert abs(np.mean(errors)) < 0.02
    assert seen.twist == pytest.approx((0.5, 0.0), abs=KERNEL)
    assert seen.odometry == pytest.approx((30.0, 0.0, 0.0), abs=0.1)


# --- lidar --------------------------------------------------------------------------------------------


@BOTH
def test_scan_noise_adds_to_the_lidars_own(kind):
    robot = shipped("jackal")
    robot.lidar.noise_std = 0.03
    clean = started(
        kind, room(8.0), dataclasses.replace(robot, lidar=dataclasses.replace(robot.lidar, noise_std=0.0))
    )
    scans = [started(kind, room(8.0), robot, seed, scan_noise=0.04)[1].scan.ranges for seed in range(10)]
    off = (np.array(scans, dtype=float) - clean[1].scan.ranges).ravel()
    assert off.std() == pytest.approx(0.05, rel=0.05)


@BOTH
@pytest.mark.parametrize("share", [0.1, 0.7, 1.0])
def test_lost_beams_return_nothing(kind, share):
    simulator, seen = started(kind, room(8.0), scan_dropout=share)
    scans = [seen.scan.ranges] + [simulator.step(Twist(0.0, 0.0)).scan.ranges for _ in range(19)]
    lost = np.array(scans) == np.float32(15.0)
    assert lost.mean() == pytest.approx(share, abs=0.02)
    if share < 1.0:
        assert (lost[0] != lost[1]).any()


@BOTH
def test_disturbances_leave_the_lidars_own_noise_alone(kind):
    robot = shipped("jackal")
    plain = started(kind, room(8.0), robot)[1].scan.ranges
    gait = {**LEGS, "ripple_v": 0.1}
    for sim in ({"scan_dropout": 0.3}, {"slip": 0.2}, {"latency": 0.1}, {"goal_noise": 0.3}, gait):
        ranges = started(kind, room(8.0), robot, **sim)[1].scan.ranges
        kept = ranges < np.float32(30.0)
        np.testing.assert_array_equal(ranges[kept], plain[kept])


# --- goal ---------------------------------------------------------------------------------------------


@BOTH
def test_the_target_errs_as_asked(kind):
    simulator, seen = started(kind, goal=(10.0, 0.0), goal_noise=0.1, goal_noise_yaw=0.03)
    targets = [seen.target] + [simulator.step(Twist(0.0, 0.0)).target for _ in range(400)]
    along, across = (np.array(targets) - [10.0, 0.0]).T
    assert along.std() == pytest.approx(0.1, rel=0.12)
    assert across.std() == pytest.approx(math.hypot(0.1, 10.0 * 0.03), rel=0.12)
    assert abs(across.mean()) < 0.08


@BOTH
def test_between_fixes_odometry_carries_the_target(kind):
    # 5 Hz control, a fix per second: errors change with every fifth observation only.
    simulator, seen = started(kind, goal=(5.0, 1.0), goal_noise=0.1, goal_rate=1.0)
    errors = []
    for _ in range(20):
        truth = to_robot(np.array([5.0, 1.0]), simulator.state.pose)
        errors.append(np.hypot(*(seen.target - truth)))
        seen = simulator.step(Twist(0.2, 0.5))
    blocks = np.array(errors).reshape(4, 5)
    assert np.ptp(blocks, axis=1) == pytest.approx(0.0, abs=1e-3)
    assert np.ptp(blocks[:, 0]) > 0.01


@BOTH
def test_rare_fixes_alone_change_nothing_and_with_slip_they_drift(kind):
    for slip, drift in ((0.0, 1e-3), (0.2, math.inf)):
        simulator, seen = started(kind, goal=(5.0, 1.0), goal_rate=0.1, slip=slip)
        for _ in range(30):
            seen = simulator.step(Twist(0.4, 0.1))
        error = math.dist(seen.target, to_robot(np.array([5.0, 1.0]), simulator.state.pose))
        assert error <= drift
        if slip:
            assert error > 0.02


def test_the_past_motion_is_interpolated_and_does_not_start_before_the_first():
    past, truth = PastMotion(0.03), {}
    for k in range(3):  # 1 m/s² from rest, seen every 0.05 s
        pose = Pose(float(k), 0.0, 0.0)
        truth[k] = Measured(pose, Twist(0.05 * k, 0.0), pose._replace(y=1.0))
        then = past.at(0.05 * k, truth[k])
        share = max(k - 0.6, 0.0)  # 0.03 s are 0.6 periods
        assert then.pose == pytest.approx((share, 0.0, 0.0), abs=KERNEL)
        assert then.twist == pytest.approx((0.05 * share, 0.0), abs=KERNEL)
        assert then.odometry == pytest.approx((share, 1.0, 0.0), abs=KERNEL)


def test_the_past_motion_may_be_older_than_a_period():
    past = PastMotion(0.12)
    poses = [past.at(0.05 * k, Measured(Pose(k, 0, 0), Twist(k, 0), Pose(k, 0, 0))).pose.x for k in range(6)]
    assert poses == pytest.approx([0.0, 0.0, 0.0, 0.6, 1.6, 2.6], abs=KERNEL)


@BOTH
def test_an_old_pose_sees_the_target_from_where_it_was_and_knows_where_the_scan_was_taken(kind):
    simulator, _ = started(kind, CLUTTER, goal=(5.0, 1.0), odometry_age=0.04)
    for _ in range(4):
        before = simulator.state.pose
        seen = simulator.step(Twist(0.2, 0.3))
    assert (
        0.0
        < math.dist(seen.odometry[:2], simulator.state.pose[:2])
        < math.dist(before[:2], simulator.state.pose[:2])
    )
    assert seen.target == pytest.approx(to_robot(np.array([5.0, 1.0]), seen.odometry), abs=KERNEL)
    assert seen.scan_pose == pytest.approx(tuple(simulator.state.pose), abs=KERNEL)


@BOTH
def test_arrival_is_judged_by_the_truth(kind):
    simulator, _ = started(kind, goal=(0.1, 0.0), goal_noise=5.0)
    assert simulator.state.arrived


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("latency", -0.1),
        ("lag", -0.1),
        ("odometry_age", -0.1),
        ("slip", math.nan),
        ("natural_frequency_v", -1.0),
        ("natural_frequency_omega", -1.0),
        ("overshoot_v", 1.5),
        ("overshoot_omega", -0.1),
        ("ripple_v", -0.1),
        ("tilt", -0.1),
        ("odometry_error", -0.1),
        ("scan_noise", math.inf),
        ("scan_dropout", 1.5),
        ("goal_noise", -1.0),
        ("goal_noise_yaw", -1.0),
        ("goal_rate", -1.0),
    ],
)
def test_bad_settings_are_named(key, value, says):
    with says.raises(InputError, match=f"{key}.*{value:g}"):
        load_settings("sim/fast", **{key: value})
