"""The clearance until the robot stands, against a slow twin, against the simulator, and by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.frames import to_robot
from lme.planners.safety.kernels import StoppingMotion, stopping_clearances
from lme.robots import reachable
from lme.simulation.fast import FastSimulator
from lme.types import Pose, Twist
from tests import oracles
from tests.builders import stage, task
from tests.stopping_states import random_points, random_robot, random_twist
from tests.tolerances import KERNEL

NONE = np.empty((0, 2))
FAR = 10.0


def found(points, twist, command, robot, under_way=(), late=0.0, lag=0.0, enough=FAR):
    sent = np.array(under_way, dtype=float).reshape(-1, 2)
    tried = np.array(command, dtype=float).reshape(-1, 2)
    motion = (*StoppingMotion(robot.limits.bounds, robot.dt, float(late), float(lag)),)
    points, box = np.array(points, dtype=float).reshape(-1, 2), (*map(float, robot.footprint.box),)
    return stopping_clearances(points, (*map(float, twist),), sent, tried, motion, box, enough)


def test_the_braking_distance_by_hand():
    """0.5 m/s, 2 m/s²: 0.1 m in the period of 0.2 s, 0.0625 m to brake, a radius of 0.2 m."""
    moving, robot = Twist(0.5, 0.0), stage()
    assert found([[1.0, 0.0]], moving, moving, robot) == pytest.approx(1.0 - 0.2 - 0.1625)
    assert found([[1.0, 0.0]], moving, (0.0, 0.0), robot) == pytest.approx(1.0 - 0.2 - 0.0625)
    assert found([[0.36, 0.0]], moving, moving, robot) == 0.0
    assert found([[-0.3, 0.0]], moving, moving, robot) == pytest.approx(0.1 + 0.1625 / 8, abs=0.02)


def test_the_search_ends_at_the_first_command_that_keeps_enough():
    clearances = found(
        [[0.45, 0.0]], (0.4, 0.0), [(0.5, 0.0), (0.2, 0.0), (0.0, 0.0), (0.3, 0.0)], stage(), enough=0.2
    )
    assert clearances[0] < clearances[1] < 0.2 == clearances[2]
    assert np.isnan(clearances[3])


def test_nothing_seen_is_nothing_touched():
    assert found(NONE, (0.5, 1.0), (0.5, 1.0), stage(), enough=0.3) == 0.3


@given(st.integers(0, 10**9), st.integers(0, 3), st.sampled_from([0.0, 0.02]), st.sampled_from([0.0, 0.2]))
def test_clearances_equal_their_slow_twin(seed, periods, late, lag):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    points = random_points(rng, robot)
    late = late if periods else 0.0
    twist, command, *sent = (random_twist(rng, robot) for _ in range(periods + 2))
    motion = StoppingMotion(robot.limits.bounds, robot.dt, late, lag)
    slow = oracles.stopping_clearance(points, (*twist,), sent, command, motion, robot.footprint)
    for enough in (FAR, 0.1):
        fast = found(points, twist, command, robot, sent, late, lag, enough)
        assert fast == pytest.approx(min(slow, enough), abs=KERNEL)


@given(st.integers(0, 10**9), st.sampled_from([(0.0, 0.0), (0.1, 0.0), (0.05, 0.0), (0.1, 0.2)]))
def test_the_motion_is_that_of_the_simulator(seed, delays):
    """A robot that gets two commands and then brakes has the clearance that the kernel foresees from its start."""
    rng, (latency, lag) = np.random.default_rng(seed), delays
    robot = stage(control_rate=10.0, footprint=random_robot(rng).footprint)
    simulator = FastSimulator(load_settings("sim/fast", latency=latency, lag=lag, max_step=0.005), robot)
    first, second = random_twist(rng, robot), random_twist(rng, robot)
    simulator.reset(task(goal=(99, 99)), rng)
    poses = [(0.0, 0.0, 0.0)]
    slower = [second]
    for _ in range(60 if lag else 15):
        slower.append(reachable(0.0, 0.0, slower[-1], robot.limits, robot.dt))
    for command in [first, *slower]:
        simulator.step(command)
        poses.extend(simulator.state.travel)
    points = random_points(rng, robot)
    points = points[np.hypot(*points.T) > robot.footprint.circumscribed_radius + 0.001]
    circles = np.column_stack([points, np.zeros(len(points))])
    driven = min(oracles.sweep(poses, robot.footprint.box, circles, [])[0], FAR)  # there may be no point
    periods = math.ceil(latency / 0.1)
    sent = [(0.0, 0.0)] * periods
    late = periods * 0.1 - latency
    early = found(points, (0.0, 0.0), second, robot, [*sent, first], late, lag)
    assert early == pytest.approx(driven, abs=0.02)  # between two poses of the coarser motion
    assert early > 0.0 or driven < 0.02


@given(st.integers(0, 10**9))
def test_after_a_period_of_braking_the_same_motion_is_left(seed):
    rng = np.random.default_rng(seed)
    robot, still = random_robot(rng), (0.0, 0.0)
    points, twist, command = random_points(rng, robot), random_twist(rng, robot), random_twist(rng, robot)
    late = 0.3 * robot.dt
    before = found(points, twist, still, robot, [command], late)[0]
    limits = robot.limits.bounds, 0.0
    way, then = oracles.followed(
        (0.0, 0.0, 0.0), (*twist,), command, robot.dt - late, limits, robot.footprint
    )
    way, then = oracles.followed((*way[-1],), then, still, late, limits, robot.footprint)
    after = found(to_robot(points, Pose(*way[-1])), then, still, robot, [still], late)[0]
    assert after >= before - KERNEL
