"""A step of a navigator whose guide or planner return what cannot be used is named."""

import math

import numpy as np
import pytest

from lme.errors import InputError
from lme.guides.lme import Lme, LmeConfig
from lme.guides.target import Target, TargetConfig
from lme.navigator import Navigator
from lme.planners.simple import Simple, SimpleConfig
from lme.sensing.people.source import Nobody
from lme.types import Guidance, Twist
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
        (Fails(), Simple(SimpleConfig(), stage()), r"Fails\.guide returned a subgoal"),
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


def sometimes_nan(candidates, view):
    """Nothing to say of what lies to the right."""
    return np.where(candidates[:, 1] < 0.0, np.nan, 1.0)


def test_a_criterion_that_gives_nan_is_named_with_the_number_of_its_values():
    config = LmeConfig(parameters={**PUBLISHED, "own": 1.0}, criteria={"own": f"{__name__}.sometimes_nan"})
    navigator = Navigator(Lme(config, stage()), Simple(SimpleConfig(), stage()))
    said = rf"^step 1: {__name__}\.sometimes_nan returned values of which \d+ of \d+ numbers are not finite"
    with pytest.raises(InputError, match=said):
        navigator.act(observation())


def test_people_are_checked(monkeypatch):
    monkeypatch.setattr(Nobody, "seen", lambda self, seen, time: seen._replace(pedestrians=None))
    navigator = Navigator(Target(TargetConfig(), stage()), Simple(SimpleConfig(), stage()), people=Nobody())
    with pytest.raises(InputError, match=r"^step 1: lme\S+Nobody\.seen returned pedestrians None"):
        navigator.act(observation())
