"""A node with `_target_`: its class, its Config, and what is said when they do not fit."""

import enum
import math
from dataclasses import dataclass, field

import pytest
from omegaconf import MISSING, OmegaConf

from lme.errors import InputError
from lme.robots import Footprint, Robot
from runners.config.instantiate import build, configured, fill_dataclass


class Colour(enum.Enum):
    RED = 1
    BLUE = 2


@dataclass(slots=True)
class Inner:
    number: int = 3


@dataclass(slots=True)
class ThingConfig:
    gain: float = 1.0
    count: int = 1
    on: bool = True
    name: str = "a"
    limit: float | None = None
    numbers: list[int] = field(default_factory=list)
    named: dict[str, float] = field(default_factory=dict)
    inner: Inner = field(default_factory=Inner)
    colour: Colour = Colour.RED
    needed: int = MISSING

    def __post_init__(self):
        if self.gain < 0:
            raise InputError(f"planner.gain is {self.gain:g}: must be at least 0")


class Thing:
    Config = ThingConfig

    def __init__(self, config, *args):
        self.config, self.args = config, args


class Bare:
    pass


TARGET = f"{__name__}.Thing"


def test_builds_with_config_and_arguments():
    thing = build({"_target_": TARGET, "gain": 2, "inner": {"number": 4}, "needed": 1}, "planner", "robot", 7)
    assert isinstance(thing, Thing)
    assert thing.args == ("robot", 7)
    assert thing.config == ThingConfig(gain=2.0, inner=Inner(4), needed=1)
    assert type(thing.config.gain) is float


def test_a_node_of_a_larger_config_is_resolved_in_it():
    config = OmegaConf.create({"seed": 5, "planner": {"_target_": TARGET, "needed": "${seed}"}})
    cls, thing = configured(config.planner, "planner")
    assert cls is Thing
    assert thing.needed == 5


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"gain": "abc"}, "planner.gain is 'abc': must be a number"),
        ({"gain": None}, "planner.gain is None: must be a number"),
        ({"gain": True}, "planner.gain is True: must be a number"),
        ({"gain": [1]}, "planner.gain is [1]: must be a number"),
        ({"gain": -1}, "planner.gain is -1: must be at least 0"),
        ({"count": 1.5}, "planner.count is 1.5: must be a whole number"),
        ({"on": "maybe"}, "planner.on is 'maybe': must be true or false"),
        ({"name": [1]}, "planner.name is [1]: must be text"),
        ({"limit": "x"}, "planner.limit is 'x': must be a number or null"),
        ({"numbers": 3}, "planner.numbers is 3: must be a list, each a whole number"),
        ({"numbers": [1.5]}, "planner.numbers is [1.5]: must be a list, each a whole number"),
        ({"named": 3}, "planner.named is 3: must be a mapping of names, each to a number"),
        ({"named": {"a": "b"}}, "planner.named.a is 'b': must be a number"),
        ({"inner": 3}, "planner.inner is 3: must be a mapping of number"),
        ({"inner": {"number": "x"}}, "planner.inner.number is 'x': must be a whole number"),
        ({"inner": {"numbr": 1}}, "planner.inner.numbr: no such key; did you mean number?"),
        ({"colour": "GREEN"}, "planner.colour is 'GREEN': must be RED or BLUE"),
        ({"gian": 1}, "planner.gian: no such key; did you mean gain?"),
        ({"gain": "${nope}"}, "nope"),
        ({}, "planner.needed has no value"),
    ],
)
def test_arguments_that_do_not_fit_the_target_are_refused(given, message):
    needed = {"needed": 1} if given else {}
    with pytest.raises(InputError) as caught:
        build({"_target_": TARGET, **needed, **given}, "planner")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ({}, "planner._target_ is None: must be the dotted path"),
        ({"_target_": "Thing"}, "planner._target_ is 'Thing': must be the dotted path"),
        ({"_target_": "../."}, "planner._target_ is '../.': must be the dotted path"),
        ({"_target_": "no_such.package.Thing"}, "cannot be imported (No module named 'no_such')"),
        ({"_target_": f"{__name__}.Thingy"}, f"did you mean Thing? {__name__} has no Thingy"),
        ({"_target_": f"{__name__}.Bare"}, "needs an attribute Config, a dataclass"),
        (3, "planner is 3: must be a mapping"),
    ],
)
def test_an_invalid_target_is_refused(node, message):
    with pytest.raises(InputError) as caught:
        build(node, "planner")
    assert message in str(caught.value)


def test_a_dataclass_with_a_required_inner_one():
    lidar = {"num_beams": 9, "fov": math.pi, "range_min": 0.1, "range_max": 9}
    limits = dict.fromkeys(("v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate"), 1)
    robot = fill_dataclass(
        Robot, {"name": "r", "footprint": {"radius": 1}, "lidar": lidar, **limits}, "robot"
    )
    assert robot.footprint == Footprint(radius=1.0)
    del lidar["range_max"]
    with pytest.raises(InputError, match=r"robot\.lidar\.range_max has no value"):
        fill_dataclass(Robot, {"name": "r", "footprint": {"radius": 1}, "lidar": lidar, **limits}, "robot")
