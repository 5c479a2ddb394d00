"""The better source of the robot's motion, worked out by hand."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.geometry.frames import compose
from lme.perception.dead_reckoning import DeadReckoning
from lme.simulation.fast import FastSimulator
from lme.types import Pose, Twist
from tests.builders import observation, stage, task
from tests.tolerances import KERNEL

DT = 0.2


def seen(twist, pose):
    return observation(twist=Twist(*twist), odometry=Pose(*pose))


def moves(*observations, dt=DT):
    reckoning = DeadReckoning(dt)
    return [reckoning.move(each) for each in observations][1:], reckoning


def test_the_first_observation_is_no_motion():
    assert DeadReckoning(DT).move(seen((0.5, 0.0), (0.0, 0.0, 0.0))) is None


def test_twists_that_explain_the_poses_are_the_source():
    (move,), reckoning = moves(seen((0.5, 0.0), (0.0, 0.0, 0.0)), seen((0.5, 0.0), (0.1, 0.0, 0.0)))
    assert move.pose is None
    assert reckoning.velocity(move) == (0.5, 0.0)


def test_so_are_those_of_a_robot_that_ramps_in_the_simulator():
    robot = stage()
    simulator, reckoning = FastSimulator(load_settings("sim/fast"), robot), DeadReckoning(robot.dt)
    reckoning.move(simulator.reset(task(goal=(50.0, 0.0)), np.random.default_rng(0)))
    rng = np.random.default_rng(1)
    for _ in range(200):
        command = Twist(*rng.uniform([-0.5, -1.5], [0.5, 1.5]).tolist())
        assert reckoning.move(simulator.step(command)).pose is None


def test_a_twist_of_zero_while_the_poses_move_is_not():
    steps = [seen((0.0, 0.0), (0.1 * k, 0.0, 0.02 * k)) for k in range(3)]
    first, second = moves(*steps)[0]
    assert first.pose == pytest.approx((0.1, 0.0, 0.02), abs=KERNEL)
    assert compose(steps[1].odometry, second.pose) == pytest.approx(steps[2].odometry, abs=KERNEL)


def test_nor_is_a_twist_that_is_the_velocity_between_two_poses():
    """It jumps, where a robot ramps: its mean over a period lags behind the motion by half a period."""
    poses = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.04, 0.0, 0.0), (0.12, 0.0, 0.0)]
    velocities = [0.0, 0.0, 0.2, 0.4]
    first, second, third = moves(*[seen((v, 0.0), pose) for v, pose in zip(velocities, poses, strict=True)])[
        0
    ]
    assert first.pose is None
    assert second.pose == (0.04, 0.0, 0.0)
    assert third.pose == pytest.approx((0.08, 0.0, 0.0), abs=KERNEL)


def test_once_refuted_the_twist_is_not_believed_again():
    between, after = moves(
        seen((0.0, 0.0), (0.0, 0.0, 0.0)),
        seen((0.0, 0.0), (0.1, 0.0, 0.0)),
        seen((0.0, 0.0), (0.1, 0.0, 0.0)),
    )[0]
    assert between.pose is not None
    assert after.pose == (0.0, 0.0, 0.0)


def test_a_pose_that_never_changes_is_no_odometry():
    still = (0.0, 0.0, 0.0)
    assert all(move.pose is None for move in moves(*[seen((0.5, 0.3), still)] * 4)[0])


def test_a_period_of_another_length_is_measured_by_the_poses():
    (move,), reckoning = moves(seen((0.5, 0.0), (0.0, 0.0, 0.0)), seen((0.5, 0.0), (0.15, 0.0, 0.0)))
    assert move.pose == (0.15, 0.0, 0.0)
    assert reckoning.velocity(move) == pytest.approx((0.75, 0.0))


def test_an_arc_is_longer_than_its_chord():
    """A turn of 0.6 rad on a radius of 0.5 m: the chord is 2 · 0.5 · sin 0.3, the way 0.3 m."""
    chord = 2 * 0.5 * math.sin(0.3)
    pose = (chord * math.cos(0.3), chord * math.sin(0.3), 0.6)
    (move,), _ = moves(seen((1.5, 3.0), (0.0, 0.0, 0.0)), seen((1.5, 3.0), pose))
    assert move.pose is None
