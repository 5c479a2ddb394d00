"""A robot that cannot back up, or only slowly: planners do not ask for it, simulators do not do it."""

from dataclasses import replace

import numpy as np
import pytest

import lme
from lme.config.presets import load_map_set, load_simulator
from lme.errors import InputError
from lme.gym.fleet import Fleet
from lme.planners.commands import limited
from lme.robots import reachable
from tests.builders import observation, stage, task

BACK = lme.Twist(-0.4, 0.3)


@pytest.mark.parametrize(("v_min", "expected"), [(None, -0.4), (-0.1, -0.1), (0.0, 0.0)])
def test_commands_stay_above_it(v_min, expected):
    robot = replace(stage(), v_min=v_min)
    assert limited(*BACK, observation(robot=robot), 1.0) == (expected, 0.3)
    assert reachable(*BACK, lme.Twist(0.0, 0.0), robot.limits, 1.0) == (expected, 0.3)


@pytest.mark.parametrize("sim", ["fast", "physics", "skid"])
def test_simulators_do_not_back_up(sim):
    robot = replace(lme.load_robot("jackal"), v_min=0.0)
    cls, config = load_simulator(sim)
    simulator = cls(config, robot)
    simulator.reset(task(), np.random.default_rng(0))
    for _ in range(5):
        simulator.step(lme.Twist(-1.0, 0.0))
    assert abs(simulator.state.pose.x) < 0.01


def test_a_fleet_does_not_back_up():
    fleet = Fleet(load_map_set("barn", {"worlds": [0]}), replace(lme.load_robot("jackal"), v_min=0.0), 2)
    before = fleet.reset([1, 2]).targets.copy()
    after = fleet.step(np.array([[-1.0, 0.0], [1.0, 0.0]])).views.targets
    assert np.array_equal(after[0], before[0])
    assert after[1, 0] < before[1, 0]


def test_it_is_not_positive(says):
    with says.raises(InputError, match="v_min.*0.1"):
        replace(stage(), v_min=0.1)
