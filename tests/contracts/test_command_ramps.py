"""Whatever twist is measured, every planner's command is within the limits and within one ramp of the last command."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.safety.filter import SafetyFilter
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Limits, Twist
from tests.builders import CLUTTER, observation, shipped, task, without_errors
from tests.contracts.test_pairs import (  # noqa: F401 - a fixture
    PLANNERS,
    TUNED_FOR,
    is_usual,
    navigator_of,
    network,
)
from tests.tolerances import KERNEL

STEPS = 25
ROUNDING = 1e-9  # of `Limits.clamped`


def planned(name):
    """The robot, a planner, and the guide of the system that it belongs to."""
    robot = TUNED_FOR.get(name.rpartition("_")[2], "go2")
    machine = without_errors(shipped(robot))
    return machine, navigator_of(machine, "lme_plus" if name.startswith("min_time") else "target", name)


def within_a_ramp(command, last, limits, dt):
    changed = np.abs(np.subtract(command, last))
    most = np.array([limits.alpha_v, limits.alpha_omega]) * dt + ROUNDING
    assert limits.lowest - ROUNDING <= command.v <= limits.v_max + ROUNDING
    assert abs(command.omega) <= limits.omega_max + ROUNDING
    assert (changed <= most).all(), (command, last)


@pytest.mark.parametrize(
    ("planner", "filtered"),
    [
        pytest.param(name, filtered, id=f"{name}-filter" if filtered else name)
        for name in PLANNERS
        for filtered in (False, True)
        if not filtered or is_usual("target", name)
    ],
)
def test_commands_ramp_from_the_last_one_whatever_is_measured(planner, filtered):
    machine, navigator = planned(planner)
    made = navigator.planner
    if filtered:
        made = SafetyFilter(load_settings("filter/stopping"), made, machine)
    simulator, rng = FastSimulator(load_settings("sim/fast"), machine), np.random.default_rng(0)
    made.reset(rng)
    navigator.guide.reset(rng)
    seen = simulator.reset(task(CLUTTER, goal=(8.0, 1.0)), rng)
    most = 2.0 * np.array([machine.v_max, machine.omega_max])
    for k in range(STEPS):
        if simulator.state.contact:
            break
        measured = Twist(*rng.uniform(-most, most).tolist()) if k % 5 else Twist(0.0, 0.0)
        told = seen._replace(twist=measured)
        command = made.plan(told, navigator.guide.guide(told))
        within_a_ramp(command, seen.last_command, machine.limits, machine.dt)
        seen = simulator.step(command)


@pytest.mark.parametrize("planner", PLANNERS)
def test_commands_are_within_the_limits_also_in_a_closed_loop(planner):
    """With CLOSED_LOOP they ramp from the measured twist, as far as that is within the limits."""
    machine, navigator = planned(planner)
    made = navigator.planner
    made.reset(np.random.default_rng(0))
    measured, limits = Twist(0.0, 1.8 * machine.omega_max), machine.limits
    told = observation(twist=measured, robot=machine)._replace(last_command=Twist(0.0, 0.0), closed_loop=True)
    command = made.plan(told, Guidance(told.target))
    within_a_ramp(command, Twist(0.0, machine.omega_max), limits, machine.dt)


def test_a_twist_a_hair_beyond_the_limits_by_rounding_stays():
    limits = Limits(0.5, 1.0, 2.0, 2.0)
    hair = Twist(np.nextafter(0.5, 1.0), np.nextafter(-1.0, -2.0))
    assert limits.clamped(hair) == hair
    assert limits.clamped(Twist(0.6, -1.8)) == (0.5, -1.0)
    assert limits._replace(v_min=0.0).clamped(Twist(-0.2, 0.0)) == (0.0, 0.0)
    assert KERNEL >= ROUNDING
