"""A step of a navigator whose guide or planner return what cannot be used is named."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.lme.guide import Lme
from lme.guides.target import Target, TargetConfig
from lme.inputs.returned import ReturnedError
from lme.navigation.navigator import Explanations, Navigator
from lme.perception.people.source import Nobody
from lme.planners.simple import Simple
from lme.types import Guidance, Pose, Twist
from tests.builders import PUBLISHED, observation, stage


class Fails:
    """A guide and a planner that goes wrong at the third step."""

    def __init__(self):
        self.steps = 0

    def reset(self, rng):
        self.steps = 0

    def _value(self):
        self.steps += 1
        return math.nan if self.steps == 3 else 0.5

    def guide(self, observation):
        return Guidance(np.array([self._value(), 0.0]))

    def plan(self, observation, guidance):
        return Twist(self._value(), 0.0)


@pytest.mark.parametrize(
    ("guide", "planner", "said"),
    [
        (Fails(), Simple(load_settings("planner/simple"), stage()), r"Fails\.guide returned a subgoal"),
        (Target(TargetConfig(), stage()), Fails(), r"Fails\.plan returned Twist\(v=nan"),
    ],
)
def test_the_step_is_counted_from_each_reset(guide, planner, said):
    navigator = Navigator(guide, planner)
    for _ in range(2):
        navigator.reset(np.random.default_rng(0))
        for _ in range(2):
            navigator.act(observation())
        with pytest.raises(InputError, match=rf"^step 3: {__name__}\.{said}"):
            navigator.act(observation())


class Explains(Fails):
    """A guide that explains itself in words."""

    def explanation(self):
        return "because"


def test_an_explanation_of_another_type_is_named(says):
    navigator = Navigator(Explains(), Simple(load_settings("planner/simple"), stage()))
    with says.raises(ReturnedError, match="'because'"):
        Explanations(navigator).new()


def sometimes_nan(candidates, view):
    """Nothing to say of what lies to the right."""
    return np.where(candidates[:, 1] < 0.0, np.nan, 1.0)


def test_a_criterion_that_gives_nan_is_named_with_the_number_of_its_values():
    config = load_settings(
        "guide/lme", parameters={**PUBLISHED, "own": 1.0}, criteria={"own": f"{__name__}.sometimes_nan"}
    )
    navigator = Navigator(Lme(config, stage()), Simple(load_settings("planner/simple"), stage()))
    said = rf"^step 1: {__name__}\.sometimes_nan returned values of which \d+ of \d+ numbers are not finite"
    with pytest.raises(InputError, match=said):
        navigator.act(observation())


def test_people_are_checked(monkeypatch, says):
    monkeypatch.setattr(Nobody, "seen", lambda self, seen, time: seen._replace(pedestrians=None))
    navigator = Navigator(
        Target(TargetConfig(), stage()), Simple(load_settings("planner/simple"), stage()), people=Nobody()
    )
    with says.raises(InputError):
        navigator.act(observation())


class Bold:
    """A user's own planner, which asks for more than the robot can do."""

    def __init__(self, omega):
        self.command = Twist(9.0, omega)

    def reset(self, rng):
        pass

    def plan(self, observation, guidance):
        return self.command


def bold(omega=-9.0, **settings):
    navigator = Navigator(Target(TargetConfig(), stage()), Bold(omega), **settings)
    navigator.reset(np.random.default_rng(0))
    return navigator


def test_a_users_own_planner_is_limited():
    navigator = bold(dt=stage().dt)
    commands = [navigator.act(observation(twist=Twist(0.9, 3.0))) for _ in range(5)]
    wanted = [(0.4, -0.4), (0.5, -0.8), (0.5, -1.2), *[(0.5, -math.pi / 2)] * 2]
    np.testing.assert_allclose(commands, wanted)
    np.testing.assert_allclose(bold().act(observation()), (0.5, -math.pi / 2))  # without a period


def test_a_command_that_was_changed_on_its_way_is_ramped_from():
    navigator = bold(dt=stage().dt)
    navigator.act(observation())
    stopped = observation()._replace(last_command=Twist(0.0, 0.0))
    assert navigator.act(stopped) == pytest.approx((0.4, -0.4))


def test_in_a_closed_loop_commands_ramp_from_the_measured_twist_within_the_limits():
    navigator = bold(dt=stage().dt, feedback="CLOSED_LOOP")
    assert navigator.act(observation(twist=Twist(0.0, 3.0))) == pytest.approx((0.4, math.pi / 2 - 0.4))
    assert navigator.act(observation(twist=Twist(0.0, 0.0))) == pytest.approx((0.4, -0.4))


def test_an_unknown_feedback_is_an_error(says):
    with says.raises(InputError, match="feedback.*'open'"):
        bold(feedback="open")


def test_at_the_goal_it_brakes_within_the_limits():
    navigator = bold(dt=stage().dt, goal_tolerance=0.2)
    for _ in range(3):
        navigator.act(observation())
    assert navigator.act(observation(target=(0.1, 0.0))) == pytest.approx((0.1, -0.8))


def driven(moves, seconds, twist=None):
    """The commands of a straight drive in which the robot makes this share of each command's way."""
    navigator, x, last, commands = bold(0.0, dt=stage().dt), 0.0, 0.0, []
    for k in range(round(seconds / stage().dt)):
        share = moves(k * stage().dt)
        x += share * last * stage().dt
        measured = Twist(share * last if twist is None else twist, 0.0)
        last = navigator.act(observation(twist=measured, odometry=Pose(x, 0.0, 0.0))).v
        commands.append(last)
    return commands


def test_a_robot_that_is_held_starts_from_rest_when_it_is_let_go():
    commands = driven(lambda t: 1.0 if t < 3.0 or t > 8.0 else 0.0, 10.0)
    assert commands[12] == 0.5
    assert commands[35] == pytest.approx(0.4)  # held for long: one ramp from the standing robot
    assert commands[-1] == 0.5


@pytest.mark.parametrize("share", [0.5, 1.0, 1.6])
def test_a_robot_that_only_lags_or_overshoots_does_not(share):
    assert driven(lambda t: share, 8.0)[5:] == [0.5] * 35


def test_nor_does_one_that_reports_no_speed_but_moves():
    assert driven(lambda t: 1.0, 8.0, twist=0.0)[5:] == [0.5] * 35


def test_the_parts_of_a_navigator_are_in_their_places(says):
    guide, planner = Target(TargetConfig(), stage()), Simple(load_settings("planner/simple"), stage())
    with says.raises(InputError, match="guide is .*Simple"):
        Navigator(planner, guide)


@pytest.mark.parametrize(
    ("key", "value", "right"),
    [
        ("people", 0.5, "must have a method seen"),
        ("people", Nobody, "class Nobody: must be an instance"),
        ("cap", 0.5, "must be a lme.robots.Cap"),
        ("lidar", 360, "must be a lme.robots.Lidar"),
    ],
)
def test_another_part_of_a_navigator_is_what_it_must_be(key, value, right, says):
    guide, planner = Target(TargetConfig(), stage()), Simple(load_settings("planner/simple"), stage())
    with says.raises(InputError, match=f"{key} is .*{right}"):
        Navigator(guide, planner, **{key: value})


def test_a_class_is_no_guide(says):
    with says.raises(InputError, match="guide is the class Target: must be an instance"):
        Navigator(Target, Simple(load_settings("planner/simple"), stage()))


@pytest.mark.parametrize("dt", [0.0, "0.05"])
def test_an_impossible_control_period_is_refused(dt, says):
    guide, planner = Target(TargetConfig(), stage()), Simple(load_settings("planner/simple"), stage())
    with says.raises(InputError, match="dt is "):
        Navigator(guide, planner, dt=dt)


def test_a_control_period_in_milliseconds_gets_a_warning(says):
    guide, planner = Target(TargetConfig(), stage()), Simple(load_settings("planner/simple"), stage())
    with says.warns(match="dt is 50 s"):
        Navigator(guide, planner, dt=50)


def test_a_seed_is_no_generator(says):
    guide, planner = Target(TargetConfig(), stage()), Simple(load_settings("planner/simple"), stage())
    with says.raises(InputError, match="rng is 0"):
        Navigator(guide, planner).reset(0)
