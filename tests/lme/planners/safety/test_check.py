"""The check counts commands under way; the nearest command is near, within reach, and lets the robot stop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.planners.safety.check import STILL, TOUCHING, StoppingCheck, StoppingState
from lme.types import Twist
from tests.builders import stage
from tests.stopping_states import random_points, random_robot, random_twist


def state(points, twist=STILL, robot=None):
    limits = (robot or stage()).limits
    return StoppingState(np.array(points, dtype=float).reshape(-1, 2), (twist,), limits, twist)


def check_of(robot, latency=0.0):
    return StoppingCheck(robot.footprint, robot.dt, latency)


@pytest.mark.parametrize(("latency", "number"), [(0.0, 0), (0.1, 1), (0.2, 1), (0.25, 2), (0.4, 2)])
def test_there_are_as_many_commands_under_way_as_the_delay_has_periods(latency, number):
    check = check_of(stage(), latency)
    assert list(check.under_way) == [STILL] * number
    check.sent(Twist(0.5, 0.0))
    assert len(check.under_way) == number
    check.reset()
    assert list(check.under_way) == [STILL] * number


def test_a_command_under_way_takes_room():
    check, now = check_of(stage(), 0.2), state([[0.27, 0.0]])
    assert check.stops(STILL, now)
    check.sent(
        Twist(0.5, 0.0)
    )  # 0.04 m in the period from rest and 0.04 m of braking, where there are 0.07 m
    assert not check.stops(STILL, now)


def test_the_nearest_command_before_a_wall_is_slower_and_as_straight():
    # 0.4 m/s: 0.05 m in the period from rest and braking; there is 0.03 m.
    command = check_of(stage()).nearest(Twist(0.4, 0.0), state([[0.23, 0.0]]))
    assert 0.0 < command.v < 0.4
    assert command.omega == 0.0


def test_the_nearest_command_keeps_the_clearance_that_is_asked():
    check, now = check_of(stage()), state([[0.25, 0.0]])
    near, far = (check.nearest(Twist(0.4, 0.0), now, enough) for enough in (0.005, 0.025))
    assert near.v > far.v > 0.0
    assert check.clearance(near, now, 1.0) >= 0.005
    assert check.clearance(far, now, 1.0) >= 0.025


def test_no_command_is_near_where_the_outline_is_touched():
    assert check_of(stage()).nearest(Twist(0.4, 0.0), state([[0.1, 0.0]])) is None


@pytest.mark.parametrize("v_min", [None, 0.0])
def test_the_nearest_command_is_one_that_the_robot_can_follow(v_min):
    robot = stage(v_min=v_min)
    command = check_of(robot).nearest(Twist(-0.5, 0.0), state([[-0.21, 0.0]], robot=robot))
    assert command.v == pytest.approx(0.0, abs=0.1)
    assert v_min is None or command.v >= 0.0


@given(st.integers(0, 10**9))
def test_the_nearest_command_stops_and_is_no_farther_than_zero_if_zero_stops(seed):
    rng = np.random.default_rng(seed)
    robot = random_robot(rng)
    check, wanted = check_of(robot), random_twist(rng, robot)
    now = state(random_points(rng, robot), Twist(0.0, 0.0), robot)
    found = check.nearest(wanted, now)
    if found is not None:
        assert check.stops(found, now)
        assert check.clearance(found, now, 1.0) >= TOUCHING
    if found is None or not check.stops(STILL, now):
        assert not check.stops(STILL, now)
        return
    away = abs(found.v - wanted.v) + robot.footprint.circumscribed_radius * abs(found.omega - wanted.omega)
    reach = robot.dt * np.array([robot.alpha_v, robot.alpha_omega])
    step = 2 * reach / [8, 14]  # between the commands that are tried
    still = abs(wanted.v) + robot.footprint.circumscribed_radius * abs(wanted.omega)
    assert away <= still + step @ [1.0, robot.footprint.circumscribed_radius]
