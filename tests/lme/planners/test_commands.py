"""The guard lets through what can be stopped in time, slows the rest, and never lets the outline touch."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.commands import StoppingGuard, limited
from lme.simulation.fast import FastSimulator
from lme.types import Pose, Twist
from lme.worlds.world import World
from tests.builders import observation, shipped, stage, task
from tests.tolerances import KERNEL

MARGIN = 0.02


def guarded(robot, wanted, points, twist=Twist(0.0, 0.0)):  # noqa: B008
    guard = StoppingGuard(robot, MARGIN)
    return guard.guard(wanted, observation(twist=twist, robot=robot), np.array(points, float).reshape(-1, 2))


def test_a_command_on_a_free_arc_passes_unchanged():
    robot, wanted = stage(), Twist(0.3, 0.2)
    expected = limited(*wanted, observation(robot=robot), robot.dt)
    assert guarded(robot, wanted, []) == expected
    assert guarded(robot, wanted, [[-1.0, 0.5], [3.0, 0.0]]) == expected


def test_a_guarded_robot_drives_no_faster_than_it_can_stop():
    # From 0.5 m/s, 0.1 m in the period and 0.0625 m of braking at 2 m/s²; 0.2 m is the robot's radius.
    robot, now = stage(), Twist(0.5, 0.0)
    enough, short = 0.2 + MARGIN + 0.1625 + 0.001, 0.2 + MARGIN + 0.1625 - 0.001
    assert guarded(robot, Twist(0.5, 0.0), [[enough, 0.0]], now).v == pytest.approx(0.5, abs=KERNEL)
    assert guarded(robot, Twist(0.5, 0.0), [[short, 0.0]], now).v < 0.5


def test_a_slowed_command_stays_on_its_arc():
    command = guarded(shipped("jackal"), Twist(1.0, 0.5), [[0.35, 0.0]])
    assert 0.0 < command.v < 1.0
    assert command.omega == pytest.approx(0.5 * command.v, abs=KERNEL)


def test_a_guarded_robot_turns_where_it_cannot_drive():
    assert guarded(stage(), Twist(0.5, 0.4), [[0.222, 0.0]]) == pytest.approx((0.0, 0.4), abs=KERNEL)


def test_a_rectangle_does_not_turn_its_corner_into_a_post():
    # The post stands 5.5 cm off Jackal's left side, 0.252 m from the centre; the corner passes at 0.261 m.
    robot = shipped("jackal")
    assert 0.0 <= guarded(robot, Twist(0.0, 2.5), [[0.14, 0.21]]).omega < 2.5
    assert guarded(robot, Twist(0.0, 2.5), [[0.17, 0.25]]).omega == pytest.approx(2.5, abs=KERNEL)
    assert guarded(robot, Twist(0.0, -2.5), [[0.14, 0.21]]).omega == pytest.approx(-2.5, abs=KERNEL)


def test_a_robot_that_is_too_near_already_may_only_back_away():
    robot = stage()
    assert guarded(robot, Twist(0.3, 0.0), [[0.21, 0.0]]) == (0.0, 0.0)
    assert guarded(robot, Twist(-0.3, 0.0), [[0.21, 0.0]]).v < 0.0


@given(st.sampled_from(["jackal", "go2", "stage"]), st.integers(0, 10**6))
def test_whatever_is_wanted_nothing_seen_is_hit(name, seed):
    rng = np.random.default_rng(seed)
    robot = shipped(name)
    angles, distances = rng.uniform(-math.pi, math.pi, 12), rng.uniform(0.6, 1.5, 12)
    posts = np.column_stack([distances * np.cos(angles), distances * np.sin(angles)])
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    seen = simulator.reset(task(World(circles=np.column_stack([posts, np.full(12, 1e-6)])), goal=(9, 9)), rng)
    guard = StoppingGuard(robot, MARGIN)
    for _ in range(20):
        pose = Pose(*simulator.state.pose)
        cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
        at = (posts - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])
        wanted = Twist(rng.uniform(-1, 1) * robot.v_max, rng.uniform(-1, 1) * robot.omega_max)
        seen = simulator.step(guard.guard(wanted, seen, at))
        assert not simulator.state.contact
