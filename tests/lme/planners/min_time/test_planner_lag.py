"""A drive that lags: its velocity is foreseen, and sent commands make up for it as far as the limits allow."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.min_time import MinTime
from lme.planners.min_time.planner import Lag
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Limits, Twist
from lme.worlds.world import World
from tests.builders import shipped, task, without_errors
from tests.tolerances import KERNEL

JACKAL = without_errors(shipped("jackal"))
LIMITS = Limits(2.0, 4.0, 20.0, 25.0)
NOW = Twist(1.0, -0.5)


def driven(actual, goal, points=(), robot=JACKAL, **config):
    """Greatest v and the last state of a drive with this lag of the simulator; points (M, 3): discs."""
    simulator, planner = (
        FastSimulator(load_settings("sim/fast", lag=actual), robot),
        MinTime(load_settings("planner/min_time", **config), robot),
    )
    world = World(circles=np.array(points, dtype=float).reshape(-1, 3))
    seen, fastest = simulator.reset(task(world, goal=goal), np.random.default_rng(0)), 0.0
    for _ in range(80):
        seen = simulator.step(planner.plan(seen, Guidance(seen.target)))
        fastest = max(fastest, seen.twist.v)
        if simulator.state.arrived or simulator.state.contact:
            break
    return fastest, simulator.state


def test_the_velocity_of_a_lagging_drive_by_hand():
    after = Lag(0.1, 0.1).after(NOW, Twist(0.0, 0.5), 0.1)
    assert after == pytest.approx((math.exp(-1.0), 0.5 - math.exp(-1.0)), abs=KERNEL)
    assert Lag(0.0, 0.1).after(NOW, Twist(0.3, 0.2), 0.1) == (0.3, 0.2)


@pytest.mark.parametrize("wanted", [Twist(1.2, -0.9), Twist(0.5, 0.0), Twist(1.0, -0.5)])
def test_the_command_leads_to_the_wanted_twist_in_a_period(wanted):
    lag = Lag(0.2, 0.1)
    command = lag.command_for(wanted, NOW, LIMITS)
    assert lag.after(NOW, command, 0.1) == pytest.approx(wanted, abs=KERNEL)


def test_the_command_stays_within_the_limits():
    lag = Lag(0.5, 0.1)
    assert lag.command_for(Twist(1.9, 3.0), NOW, LIMITS) == (2.0, 4.0)
    assert lag.command_for(Twist(0.0, -3.0), NOW, LIMITS._replace(v_min=-0.3)) == (-0.3, -4.0)
    assert Lag(0.0, 0.1).command_for(Twist(1.9, 3.0), NOW, LIMITS) == (1.9, 3.0)


def test_the_reach_is_that_of_the_greatest_commands():
    lag = Lag(0.2, 0.1)
    least, most = lag.reach(NOW, LIMITS)
    assert lag.command_for(least, NOW, LIMITS) == pytest.approx((-2.0, -4.0), abs=KERNEL)
    assert lag.command_for(most, NOW, LIMITS) == pytest.approx((2.0, 4.0), abs=KERNEL)


def test_a_robot_that_knows_its_lag_turns_to_a_subgoal_sooner():
    unknown, known = (driven(0.3, (0.0, 4.0), lag=lag)[1] for lag in (0.0, 0.3))
    assert unknown.arrived
    assert known.arrived
    assert known.time < unknown.time - 0.1


@pytest.mark.parametrize("v_min", [None, 0.0])
@pytest.mark.parametrize("lag", [0.3, 0.6])
def test_a_known_lag_is_counted_before_a_wall(lag, v_min):
    robot, wall = replace(JACKAL, v_min=v_min), [(4.0, y, 0.05) for y in np.arange(-3.0, 3.01, 0.1)]
    fastest, state = driven(lag, (8.0, 0.0), wall, robot, lag=lag)
    assert fastest > 0.5
    assert not state.contact


def test_an_unknown_lag_ends_at_the_wall():
    wall = [(4.0, y, 0.05) for y in np.arange(-3.0, 3.01, 0.1)]
    assert driven(1.0, (8.0, 0.0), wall)[1].contact


def test_the_twist_after_a_delay_and_a_lag_is_foreseen():
    planner = MinTime(load_settings("planner/min_time", latency=0.1, lag=0.2), JACKAL)
    simulator = FastSimulator(load_settings("sim/fast", latency=0.1, lag=0.2), JACKAL)
    seen = simulator.reset(task(goal=(50.0, 3.0)), np.random.default_rng(0))
    for _ in range(8):
        foreseen = planner._predict(seen.twist, seen.limits)[1]
        seen = simulator.step(planner.plan(seen, Guidance(seen.target)))
        assert seen.twist == pytest.approx(foreseen, abs=1e-6)
    assert foreseen.v > 0.5
