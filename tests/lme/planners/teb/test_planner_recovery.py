"""Recoveries: how long the horizon is short, and when turns keep to one side."""

import pytest

from lme.config.presets import load_settings
from lme.planners.teb.planner import Horizon, Oscillation
from lme.types import Twist

DT = 0.1


def test_a_failure_halves_the_horizon_for_ten_seconds():
    horizon = Horizon(load_settings("planner/teb"), DT)
    assert horizon.share == 1.0
    horizon.record(failed=True)
    for _ in range(100):
        assert horizon.share == 0.5
        horizon.record(failed=False)
    assert horizon.share == 1.0


def test_ten_failures_in_a_row_leave_a_quarter():
    horizon = Horizon(load_settings("planner/teb"), DT)
    for _ in range(9):
        horizon.record(failed=True)
    assert horizon.share == 0.5
    horizon.record(failed=True)
    assert horizon.share == 0.25
    horizon.record(failed=False)
    assert horizon.share == 0.5
    horizon.reset()
    assert horizon.share == 1.0


def told(*commands, omega=0.5):
    oscillation = Oscillation(load_settings("planner/teb"), DT, 0.8, 1.57)
    for command in commands:
        oscillation.record(Twist(*command), omega)
    return oscillation


@pytest.mark.parametrize(("omega", "side"), [(0.4, 1.0), (-0.4, -1.0)])
def test_turns_to_and_fro_on_the_spot_choose_a_side(omega, side):
    assert told(*[(0.0, 0.5), (0.0, -0.5)] * 25, omega=omega).turn == side


@pytest.mark.parametrize(
    "commands",
    [
        [(0.0, 0.5), (0.0, -0.5)] * 24,  # not yet half the window
        [(0.5, 0.5), (0.5, -0.5)] * 50,  # drives
        [(0.0, 0.5)] * 100,  # turns
        [(0.0, 0.0)] * 100,  # stands
    ],
)
def test_other_commands_choose_none(commands):
    assert told(*commands).turn == 0.0


def test_the_side_is_kept_for_ten_seconds_after_the_last_oscillation():
    oscillation = told(*[(0.0, 0.5), (0.0, -0.5)] * 50)
    periods = 0
    while oscillation.turn != 0.0:
        oscillation.record(Twist(0.8, 0.0), -0.5)
        periods += 1
    assert 100 <= periods <= 115  # the mean velocity first has to rise
