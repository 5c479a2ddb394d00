"""Hints and bounds of the one error that a user can fix."""

import math

import pytest

from lme.errors import InputError, building, nearest, require


@pytest.mark.parametrize(
    ("name", "hint"), [("jakal", "did you mean jackal? "), ("stag", "did you mean stage? "), ("xyz", "")]
)
def test_the_nearest_name_is_offered_if_one_is_similar(name, hint):
    assert nearest(name, {"jackal", "stage", "go2"}) == hint


@pytest.mark.parametrize(
    ("value", "bounds"),
    [
        (0.0, {"above": 0.0}),
        (-1, {"at_least": 0, "at_most": 2}),
        (math.inf, {"at_least": 0}),
        (math.nan, {}),
        (10**400, {"above": 0.0}),
    ],
)
def test_a_value_out_of_bounds_is_named_with_its_bounds(value, bounds, says):
    with says.raises(InputError):
        require("robot.v_max", value, **bounds)


def test_a_value_on_a_closed_bound_is_right():
    require("robot.v_max", 2.0, at_least=2.0, at_most=2.0)


def test_a_line_break_in_a_name_does_not_break_the_message():
    assert str(InputError("key line\nbreak is 3: must be 4")) == "key line break is 3: must be 4"


def test_what_is_built_from_a_config_names_its_key():
    with building("planner"):
        with building("planner.costmap"), pytest.raises(InputError, match=r"^planner\.costmap\.size is -1"):
            require("size", -1, at_least=0)
        with pytest.raises(InputError, match=r"^planner\.margin is -1"):
            require("margin", -1, at_least=0)
    with pytest.raises(InputError, match=r"^margin is -1"):
        require("margin", -1, at_least=0)
