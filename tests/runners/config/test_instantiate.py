"""A node with `_target_`: its class, its Config, and what is said when they do not fit."""

import enum
import json
import math
import re
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
    thing = build(
        {"_target_": TARGET, "gain": 2, "inner": {"number": 4}, "needed": 1}, "planner", robot="robot", n=7
    )
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
    "given",
    [
        {"gain": "abc"},
        {"gain": None},
        {"gain": True},
        {"gain": [1]},
        {"gain": -1},
        {"count": 1.5},
        {"on": "maybe"},
        {"name": [1]},
        {"limit": "x"},
        {"numbers": 3},
        {"numbers": [1.5]},
        {"named": 3},
        {"named": {"a": "b"}},
        {"inner": 3},
        {"inner": {"number": "x"}},
        {"inner": {"numbr": 1}},
        {"colour": "GREEN"},
        {"gian": 1},
        {"gain": "${nope}"},
        {},
    ],
    ids=str,
)
def test_arguments_that_do_not_fit_the_target_are_refused(given, says):
    needed = {"needed": 1} if given else {}
    with says.raises(InputError):
        build({"_target_": TARGET, **needed, **given}, "planner")


@pytest.mark.parametrize(
    "node",
    [
        {},
        {"_target_": "Thing"},
        {"_target_": "../."},
        {"_target_": "no_such.package.Thing"},
        {"_target_": f"{__name__}.Thingy"},
        {"_target_": f"{__name__}.Bare"},
        3,
    ],
)
def test_an_invalid_target_is_refused(node, says):
    with says.raises(InputError):
        build(node, "planner")


def test_a_file_that_another_module_hides_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, file in (("json", json.__file__), ("sys", "built in")):
        said = f"planner._target_ is {name}.Pqzx: {name} ({file}) has no Pqzx"
        with pytest.raises(InputError, match=f"^{re.escape(said)}$"):
            build({"_target_": f"{name}.Pqzx"}, "planner")
        (tmp_path / f"{name}.py").touch()
        said += f"; it hides {name}.py in the working folder, which must be renamed"
        with pytest.raises(InputError, match=f"^{re.escape(said)}$"):
            build({"_target_": f"{name}.Pqzx"}, "planner")


def test_a_dataclass_with_a_required_inner_one(says):
    lidar = {"num_beams": 9, "fov": math.pi, "range_min": 0.1, "range_max": 9}
    limits = dict.fromkeys(("v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate"), 1)
    robot = fill_dataclass(
        Robot, {"name": "r", "footprint": {"radius": 1}, "lidar": lidar, **limits}, "robot"
    )
    assert robot.footprint == Footprint(radius=1.0)
    del lidar["range_max"]
    with says.raises(InputError):
        fill_dataclass(Robot, {"name": "r", "footprint": {"radius": 1}, "lidar": lidar, **limits}, "robot")
