"""Odometry whose scales are wrong: the believed pose drifts in proportion to the way, in every simulator."""

import math
from functools import partial

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.geometry.frames import relative, to_robot, to_world
from lme.simulation.disturbances import Odometry
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.simulation.substeps import rolled
from lme.types import Pose, Twist
from tests.builders import CLUTTER, shipped, stage, task
from tests.tolerances import KERNEL

KINDS = {
    "fast": (FastSimulator, partial(load_settings, "sim/fast"), stage()),
    "physics": (PhysicsSimulator, partial(load_settings, "sim/physics"), stage()),
    "skid": (SkidSimulator, partial(load_settings, "sim/skid"), shipped("jackal_real")),
}
ALL = pytest.mark.parametrize("kind", list(KINDS))
REST = Pose(0.0, 0.0, 0.0)


def started(kind, seed=0, world=None, goal=(1e3, 0.0), **sim):
    """A simulator at the start of a task, and its first observation."""
    simulator_class, config_class, robot = KINDS[kind]
    calm = {"yaw_noise": 0.0} if kind == "skid" else {}
    simulator = simulator_class(config_class(**calm, **sim), robot)
    return simulator, simulator.reset(task(world, goal=goal), np.random.default_rng(seed))


def walked(steps, seed, error=0.03):
    """The believed pose after `steps`, each of 0.1 m and a turn [rad] of its own."""
    odometry, true = Odometry(error, np.random.default_rng(seed)), REST
    for turn in steps:
        true = rolled(true, (0.1, turn))
        _, believed = odometry.measured(Twist(0.5, 0.0), true)
    return true, believed


@pytest.mark.parametrize("length", [5.0, 20.0])
def test_the_error_after_a_straight_way_is_as_large_a_share_of_it_as_asked_for(length):
    ends = [walked([0.0] * round(length / 0.1), seed)[1] for seed in range(400)]
    errors = np.array([end.x for end in ends]) / length - 1.0
    assert errors.std() == pytest.approx(0.03, rel=0.1)
    assert abs(errors.mean()) < 0.006
    assert all(end[1:] == (0.0, 0.0) for end in ends)


def test_the_error_of_the_heading_is_as_large_a_share_of_the_turn():
    turn = math.pi / 2
    ends = [walked([turn / 10] * 10, seed)[1] for seed in range(400)]
    assert np.std([end.yaw / turn for end in ends]) == pytest.approx(0.03, rel=0.1)


def test_the_error_on_a_winding_way_grows_with_it():
    turns = np.random.default_rng(1).choice([-0.2, 0.0, 0.2], 400)
    errors = np.empty((100, 2))
    for seed in range(100):
        for k, count in enumerate((100, 400)):
            true, believed = walked(turns[:count], seed)
            errors[seed, k] = math.dist(true[:2], believed[:2])
    near, far = np.sqrt((errors**2).mean(axis=0))
    assert near < far < 0.06 * 40.0
    assert 0.01 * 10.0 < near < 0.06 * 10.0


def test_the_believed_way_is_that_of_the_measured_twist():
    odometry, true, believed = Odometry(0.1, np.random.default_rng(2)), REST, REST
    for v, omega in ((0.5, 0.0), (0.5, 1.2), (-0.3, -0.7), (0.0, 2.0)):
        true = rolled(true, (v * 0.1, omega * 0.1))
        twist, pose = odometry.measured(Twist(v, omega), true)
        believed = rolled(believed, (twist.v * 0.1, twist.omega * 0.1))
        assert pose == pytest.approx(believed, abs=KERNEL)
        assert twist != Twist(v, omega)


def test_without_an_error_the_measurement_is_the_truth_itself():
    odometry, twist, pose = Odometry(0.0, np.random.default_rng(0)), Twist(0.5, 0.1), Pose(0.1, 0.2, 0.3)
    assert odometry.measured(twist, pose) == (twist, pose)


@ALL
def test_pose_twist_and_target_err_alike_in_every_simulator(kind):
    goal = np.array([8.0, 3.0])
    exact, _ = started(kind, goal=goal)
    simulator, seen = started(kind, goal=goal, odometry_error=0.1, goal_rate=0.0)
    for _ in range(25):
        true, seen = exact.step(Twist(0.4, 0.3)), simulator.step(Twist(0.4, 0.3))
        assert simulator.state.pose == exact.state.pose
    scale_v, scale_omega = seen.twist.v / true.twist.v, seen.twist.omega / true.twist.omega
    assert seen.odometry.yaw == pytest.approx(scale_omega * true.odometry.yaw, abs=KERNEL)
    assert abs(scale_v - 1.0) > 1e-3
    assert abs(scale_omega - 1.0) > 1e-3
    np.testing.assert_allclose(to_world(seen.target, seen.odometry), goal, atol=KERNEL)
    believed = relative(simulator.state.pose, REST)
    assert math.dist(seen.target, to_robot(goal, believed)) > 0.01


@ALL
def test_with_a_localised_goal_the_target_is_exact(kind):
    simulator, _ = started(kind, goal=(8.0, 3.0), odometry_error=0.1, goal_rate=None)
    for _ in range(10):
        seen = simulator.step(Twist(0.4, 0.3))
    np.testing.assert_array_equal(seen.target, to_robot(np.array([8.0, 3.0]), simulator.state.pose))


@ALL
def test_no_other_random_stream_moves(kind):
    others = {"slip": 0.1, "scan_noise": 0.02, "scan_dropout": 0.1, "goal_noise": 0.1, "goal_rate": None}
    plain, erring = (
        started(kind, world=CLUTTER, goal=(10.0, 3.0), **others, **own)[0]
        for own in ({}, {"odometry_error": 0.1})
    )
    for _ in range(10):
        one, two = plain.step(Twist(0.2, 0.3)), erring.step(Twist(0.2, 0.3))
        assert plain.state.pose == erring.state.pose
        np.testing.assert_array_equal(one.scan.ranges, two.scan.ranges)
        np.testing.assert_allclose(
            one.target, two.target, atol=KERNEL
        )  # up to rounding: it passes another frame
    assert one.twist != two.twist


@ALL
def test_every_episode_has_errors_of_its_own_that_last(kind):
    scales = set()
    for seed in range(3):
        simulator, _ = started(kind, seed, odometry_error=0.1)
        exact, _ = started(kind, seed)
        twists = [
            (simulator.step(Twist(0.4, 0.3)).twist, exact.step(Twist(0.4, 0.3)).twist) for _ in range(10)
        ]
        own = {round(seen.v / true.v, 9) for seen, true in twists if true.v > 1e-3}
        assert len(own) == 1
        scales |= own
    assert len(scales) == 3
