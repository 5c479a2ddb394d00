"""Algorithm 3: turn, then drive; within the limits, and never past the mark."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.commands import approach
from lme.planners.simple import Simple
from lme.robots import towards
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Limits, Pose, Twist
from tests.builders import SHIPPED, observation, shipped, stage, task
from tests.tolerances import KERNEL

UNIT = st.floats(0.0, 1.0)
SIGNED = st.floats(-1.0, 1.0)


def plan(subgoal, twist=Twist(0.0, 0.0), robot=None, limits=None, **config):  # noqa: B008
    robot = robot or stage()
    view = observation(twist=twist, robot=robot)
    if limits is not None:
        view = view._replace(limits=limits)
    return Simple(load_settings("planner/simple", **config), robot).plan(
        view, Guidance(np.array(subgoal, dtype=float))
    )


def at_bearing(degrees, distance=3.0):
    return distance * math.cos(math.radians(degrees)), distance * math.sin(math.radians(degrees))


@pytest.mark.parametrize("side", [1, -1])
def test_simple_drives_only_within_nine_degrees_of_the_subgoal(side):
    # From rest, 2 m/s² for 0.2 s: 0.4 m/s. At 0.3 m/s out of the cone it brakes, to 0 in one period.
    assert plan(at_bearing(8.9 * side)).v == pytest.approx(0.4, abs=KERNEL)
    assert plan(at_bearing(9.1 * side)).v == 0.0
    assert plan(at_bearing(8.9 * side), Twist(0.3, 0.0)).v == pytest.approx(0.5, abs=KERNEL)
    assert plan(at_bearing(9.1 * side), Twist(0.3, 0.0)).v == 0.0
    assert plan(at_bearing(9.1 * side), Twist(0.5, 0.0)).v == pytest.approx(0.1, abs=KERNEL)


def test_the_cone_is_a_setting():
    assert plan(at_bearing(20.0), heading_tolerance=math.radians(25.0)).v > 0.0
    assert plan(at_bearing(5.0), heading_tolerance=math.radians(3.0)).v == 0.0


@pytest.mark.parametrize("degrees", [1.0, 8.0, 20.0, 90.0, 179.0])
def test_simple_turns_towards_the_subgoal(degrees):
    assert plan(at_bearing(degrees)).omega > 0.0
    assert plan(at_bearing(-degrees)).omega == -plan(at_bearing(degrees)).omega


def test_pd_near_the_direction_of_the_subgoal():
    # Bearing 0.05, ω 0.1: 4 · 0.05 − 0.1 · 0.1 = 0.19 rad/s, slower than what could stop there: 0.2106 (from
    # 0.05 rad: 0.1·0.2 + 0.1²/4 = 0.0225 ≤ 0.05, u = (0.05 + 0.0025)/(0.2 + 0.05) = 0.21).
    assert plan((3 * math.cos(0.05), 3 * math.sin(0.05)), Twist(0.0, 0.1)).omega == pytest.approx(
        0.19, abs=KERNEL
    )
    # Above pd_below, the fastest that still stops.
    held = plan((3 * math.cos(0.05), 3 * math.sin(0.05)), Twist(0.0, 0.1), pd_below=0.0).omega
    assert held == pytest.approx(0.21, abs=KERNEL)


def limits_of(draws):
    a, b, c, d = draws
    return Limits(0.1 + 3 * a, 0.1 + 5 * b, 0.1 + 20 * c, 0.1 + 25 * d)


@given(st.tuples(UNIT, UNIT, UNIT, UNIT), SIGNED, SIGNED, st.floats(-6, 6), st.floats(-6, 6))
def test_commands_keep_to_the_limits_observed(draws, v, omega, x, y):
    # Those of the observation, not those that the planner may have been built with.
    limits = limits_of(draws)
    twist = Twist(v * limits.v_max, omega * limits.omega_max)
    command = plan((x, y), twist, limits=limits)
    assert abs(command.v) <= limits.v_max + KERNEL
    assert abs(command.omega) <= limits.omega_max + KERNEL
    assert abs(command.v - twist.v) <= limits.alpha_v * 0.2 + KERNEL
    assert abs(command.omega - twist.omega) <= limits.alpha_omega * 0.2 + KERNEL


def test_accelerations_of_the_planner_replace_the_robots():
    # From rest, 0.5 m/s² and 0.8 rad/s² for 0.2 s: 0.1 m/s and 0.16 rad/s, where the robot's own 2 and 2 give 0.4.
    ahead, aside = at_bearing(0.0), at_bearing(90.0)
    assert plan(ahead, alpha_v=0.5).v == pytest.approx(0.1, abs=KERNEL)
    assert plan(ahead, alpha_omega=0.8).v == pytest.approx(0.4, abs=KERNEL)
    assert plan(aside, alpha_omega=0.8).omega == pytest.approx(0.16, abs=KERNEL)
    assert plan(aside, alpha_v=0.5).omega == pytest.approx(0.4, abs=KERNEL)


def test_accelerations_of_the_planner_are_at_most_the_robots():
    for degrees in (5.0, 90.0):
        assert plan(at_bearing(degrees), alpha_v=7.0, alpha_omega=7.0) == plan(at_bearing(degrees))


def test_simple_brakes_as_hard_as_the_robot_can_outside_the_cone():
    # Algorithm 3: the command is 0 there. At 0.5 m/s the robot's 2 m/s² allow 0.1 after 0.2 s.
    assert plan(at_bearing(9.1), Twist(0.5, 0.0), alpha_v=0.5).v == pytest.approx(0.1, abs=KERNEL)


def travelled(rate, command, alpha, dt):
    """Way in one period in which the rate goes to the command at alpha and then holds."""
    ramp = abs(command - rate) / alpha
    assert ramp <= dt * (1 + 1e-9)
    return (rate + command) / 2 * ramp + command * (dt - ramp)


def follow(error, rate, rate_max, alpha, dt, periods):
    """Errors left after each period of following `approach`."""
    left = []
    for _ in range(periods):
        command = approach(error, rate, rate_max, alpha, dt)
        error -= travelled(rate, command, alpha, dt)
        rate = command
        left.append(error)
    return np.array(left), rate


PERIODS = st.sampled_from([0.05, 0.1, 0.125, 0.2])


@settings(max_examples=300)
@given(SIGNED, SIGNED, st.floats(0.2, 4.0), st.floats(0.2, 25.0), PERIODS)
def test_simple_stays_able_to_stop_or_brakes(error, share, rate_max, alpha, dt):
    error, rate = 4.0 * error, share * rate_max
    sign = math.copysign(1.0, error)
    command = approach(error, rate, rate_max, alpha, dt)
    braking = max(sign * rate, 0.0) ** 2 / (2 * alpha)
    if braking > abs(error):
        assert command == towards(0.0, rate, alpha, dt)
        return
    ahead = sign * (error - travelled(rate, command, alpha, dt))
    assert ahead >= -KERNEL
    assert max(sign * command, 0.0) ** 2 / (2 * alpha) <= ahead + KERNEL


@settings(max_examples=300)
@given(UNIT, SIGNED, st.floats(0.2, 4.0), st.floats(0.2, 25.0), PERIODS)
def test_approach_arrives(error, share, rate_max, alpha, dt):
    error = 0.01 + 4.0 * error
    rate = share * min(rate_max, math.sqrt(2 * alpha * error))
    periods = int((error + 2 * rate_max**2 / alpha) / rate_max / dt + 4 * rate_max / alpha / dt) + 200
    left, rate = follow(error, rate, rate_max, alpha, dt, periods)
    assert left.min() >= -KERNEL
    assert left[-1] <= 1e-4
    assert abs(rate) <= 1e-2


@given(SIGNED, SIGNED, st.floats(0.2, 4.0), st.floats(0.2, 25.0), PERIODS)
def test_approach_is_odd_and_within_limits(error, share, rate_max, alpha, dt):
    assume(error != 0.0)
    rate = share * rate_max
    command = approach(error, rate, rate_max, alpha, dt)
    assert approach(-error, -rate, rate_max, alpha, dt) == -command
    assert abs(command) <= rate_max + KERNEL
    assert abs(command - rate) <= alpha * dt + KERNEL


def test_approach_is_as_fast_as_can_be():
    # A little faster and it could not stop: 1 m ahead, 0.5 m/s, 2 m/s², 0.2 s.
    command = approach(1.0, 0.5, 10.0, 0.8, 0.2)
    assert command == pytest.approx(0.5 + 0.8 * 0.2, abs=KERNEL)  # held back by alpha alone
    command = approach(0.3, 0.5, 10.0, 2.0, 0.2)
    way = travelled(0.5, command, 2.0, 0.2) + command**2 / (2 * 2.0)
    assert way == pytest.approx(0.3, abs=KERNEL)


def test_towards_takes_one_period_at_alpha():
    assert towards(5.0, 1.0, 2.0, 0.2) == pytest.approx(1.4, abs=KERNEL)
    assert towards(-5.0, 1.0, 2.0, 0.2) == pytest.approx(0.6, abs=KERNEL)
    assert towards(1.1, 1.0, 2.0, 0.2) == 1.1


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("start_rad", [0.1, -0.5, 2.0, -3.0])
def test_no_shipped_robot_turns_past_its_subgoal_or_drives_past_it(name, start_rad):
    robot = shipped(name)
    simulator, planner = (
        FastSimulator(load_settings("sim/fast"), robot),
        Simple(load_settings("planner/simple"), robot),
    )
    job = task(start=Pose(0.0, 0.0, -start_rad), goal=(3.0, 0.0), goal_tolerance=1e-3)
    view = simulator.reset(job, np.random.default_rng(0))
    worst, twists = 0.0, []
    for _ in range(400):
        view = simulator.step(planner.plan(view, Guidance(view.target)))
        twists.append(view.twist)
        if simulator.state.arrived:
            break
        bearing = math.atan2(view.target[1], view.target[0])
        if np.hypot(*view.target) > 0.2:
            worst = max(worst, -math.copysign(1.0, start_rad) * bearing)
    assert simulator.state.arrived
    # Driving while it still turns moves the mark itself a little.
    assert worst < 0.02
    assert max(abs(twist.v) for twist in twists) <= robot.v_max + KERNEL
    assert max(abs(twist.omega) for twist in twists) <= robot.omega_max + KERNEL
