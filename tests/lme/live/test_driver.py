"""The live driver: whatever its guide and planner do, the robot drives only when it may, within its limits."""

import math

import numpy as np
import pytest

from lme.live.step import LiveState
from lme.types import Twist
from tests import builders
from tests.lme.live.rig import CRUISE, FAR, Rig, drives, stands
from tests.made_bags import SECOND


def test_the_driver_drives_to_its_goal(rig):
    step = rig.drive()
    assert drives(step)
    assert step.goal == 1
    np.testing.assert_allclose(step.observation.target, FAR)
    assert step.observation.limits == rig.robot.limits
    assert step.wanted == CRUISE


@pytest.mark.parametrize("command", ["new goal", "cancel", "stop"])
def test_an_event_during_a_decision_stops_the_driver(rig, command):
    rig.drive()

    def meanwhile():
        if command == "new goal":
            rig.driver.set_goal((0.0, 7.0), "", rig.now)
        elif command == "cancel":
            rig.driver.cancel()
        else:
            rig.driver.stop("shutdown")
        return CRUISE

    rig.puppet.command = meanwhile
    step = rig.period()
    assert step.command == Twist(0.0, 0.0)
    assert step.state is (LiveState.CANCELLED if command == "cancel" else LiveState.STOPPED)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (Twist(math.nan, 0.0), "Puppet.plan returned Twist(v=nan, omega=0.0)"),
        (Twist(0.0, math.inf), "both finite"),
        (None, "both finite"),
        (ZeroDivisionError("no"), "rig.py:"),
    ],
)
def test_a_planner_that_fails_stops_the_driver(rig, command, reason):
    rig.drive()
    rig.puppet.command = command
    assert stands(rig.period(), reason)
    rig.puppet.command = CRUISE
    assert drives(rig.period())


def test_a_decision_that_takes_too_long_does_not_count(rig):
    rig.drive()

    def slow():
        rig.wall += round(0.6 * SECOND)
        return CRUISE

    rig.puppet.command = slow
    assert stands(rig.period(), "the decision took 0.60 s")


def test_a_navigator_that_cannot_be_built_is_reported():
    rig = Rig(navigator=lambda robot: builders.Simple(None, None))
    rig.sense()
    assert stands(rig.tick(), "AttributeError")


def test_after_shutdown_the_driver_stands_for_good(rig):
    rig.drive()
    assert stands(rig.driver.stop("shutdown"), "shutdown")
    rig.driver.set_goal(FAR, "odom", rig.now)
    assert stands(rig.period(), "shutdown")


def test_commands_are_within_the_limits(rig):
    rig.puppet.command = Twist(9.0, -9.0)
    steps = [rig.drive(), *(rig.period() for _ in range(5))]
    np.testing.assert_allclose(
        [step.command for step in steps],
        [(0.4, -0.4), (0.5, -0.8), (0.5, -1.2), *[(0.5, -math.pi / 2)] * 3],
    )
    assert steps[0].wanted == (0.5, -math.pi / 2)


def test_after_a_stop_the_driver_starts_from_rest(rig):
    rig.puppet.command = Twist(0.5, 0.0)
    rig.drive()
    assert rig.period().command.v == 0.5
    rig.pass_time(0.8)
    rig.tick()
    assert rig.period().command.v == pytest.approx(0.4)
