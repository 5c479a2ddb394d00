"""The invariant of docs/understand/safety.md: from where the robot can stop, the command leads to such a state."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.min_time import MinTime
from tests.stopping_states import random_steps


def made(robot, latency=0.0, lag=0.0):
    return MinTime(load_settings("planner/min_time", latency=latency, lag=lag), robot)


@pytest.fixture(autouse=True)
def turns_at_once():
    """It makes multi-point turns as soon as the guide is blocked."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lme.planners.min_time.multi_point_turn._AFTER", 1e-6)
        yield


@given(st.integers(0, 10**9))
def test_from_a_state_in_which_the_robot_can_stop_the_command_leads_to_another_one(seed):
    assert random_steps(made, np.random.default_rng(seed), 100).broken == 0


@pytest.mark.slow
def test_a_million_random_steps_keep_the_robot_able_to_stop():
    steps = random_steps(made, np.random.default_rng(0), 1_000_000)
    print(steps)
    assert steps.broken == 0


def test_without_the_check_the_invariant_does_not_hold(monkeypatch):
    """So the random states do reach what the margins of the arcs alone do not cover."""
    monkeypatch.setattr(MinTime, "_stoppable", lambda self, command, now: command)
    assert random_steps(made, np.random.default_rng(0), 3000).broken > 0
