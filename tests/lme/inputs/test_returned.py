"""What a user's own guide, planner, criterion, simulator or source of people may return; anything else is named."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from lme.inputs.returned import (
    ReturnedError,
    checked_command,
    checked_guidance,
    checked_observation,
    checked_people,
    checked_values,
    dotted_name,
)
from lme.types import Guidance, Pose, Twist
from tests.builders import observation

HERE = np.array([1.0, 0.5])
PATH = np.array([[0.0, 0.0], [1.0, 0.5]])


class Own:
    """A guide, a planner, a simulator."""


class State(NamedTuple):
    """Of a simulator, as far as it is checked."""

    pose: Pose = Pose(0.0, 0.0, 0.0)
    time: float = 0.0


def own_criterion(candidates, view):
    """A criterion."""


def test_a_function_and_an_object_have_dotted_names():
    assert dotted_name(own_criterion) == f"{__name__}.own_criterion"
    assert dotted_name(Own()) == f"{__name__}.Own"


@pytest.mark.parametrize(
    "command", [Twist(0.5, -0.1), (0.5, -0.1), [0.5, -0.1], np.array([0.5, -0.1], np.float64)]
)
def test_a_pair_of_numbers_is_a_command(command):
    assert checked_command(command, Own()) == Twist(0.5, -0.1)


@pytest.mark.parametrize(
    "command",
    [
        Twist(math.nan, 0.0),
        (0.0, -math.inf),
        (10**400, 0.0),
        (1j, 0.0),
        ("0.5", "0.1"),
        "12",
        (True, 0.0),
        {0.5: 1, 0.1: 2},
        {0.5, 0.1},
        (0.5,),
        (0.5, 0.1, 0.0),
        np.zeros((2, 2)),
        0.5,
        None,
    ],
)
def test_any_other_command_is_refused_with_the_planners_name(command):
    with pytest.raises(ReturnedError, match=rf"^{__name__}\.Own\.plan returned .*both finite numbers$"):
        checked_command(command, Own())


def test_good_guidance_is_returned_as_it_is():
    guidance = Guidance(HERE, PATH, np.bool_(True), False, np.empty((0, 2)), PATH)
    assert checked_guidance(guidance, Own()) is guidance


@pytest.mark.parametrize("subgoal", [(1, 2), [1.0, 2.0], np.array([1, 2]), np.array([1, 2], np.float32)])
def test_a_subgoal_of_other_numbers_becomes_floats(subgoal):
    checked = checked_guidance(Guidance(subgoal, PATH[:, ::-1]), Own())
    assert checked.subgoal.tolist() == [1.0, 2.0]
    assert checked.subgoal.dtype == checked.path.dtype == np.float64
    assert checked.path.flags.c_contiguous


@pytest.mark.parametrize(
    "guidance",
    [
        None,
        (HERE, None),
        Guidance(np.array([math.nan, 1.0])),
        Guidance(np.zeros(3)),
        Guidance(np.zeros((1, 2))),
        Guidance(["1", "2"]),
        Guidance(np.array([1j, 0.0])),
        Guidance(None),
        Guidance([[1.0], [1.0, 2.0]]),
        Guidance(HERE, np.array([[0.0, 0.0], [math.inf, math.nan]])),
        Guidance(HERE, np.zeros((3, 3))),
        Guidance(HERE, np.empty((0, 2))),
        Guidance(HERE, points=np.array([[math.nan, 0.0]])),
        Guidance(HERE, way=np.zeros(2)),
        Guidance(HERE, None, "no"),
        Guidance(HERE, None, False, math.nan),
    ],
)
def test_any_other_guidance_is_refused_with_the_guides_name(guidance, says):
    with says.raises(ReturnedError):
        checked_guidance(guidance, Own())


@pytest.mark.parametrize("values", [[1, 2, 3], np.array([True, False, True]), np.array([1.0, -2.0, 0.5])])
def test_a_number_for_each_candidate_is_what_a_criterion_gives(values):
    assert checked_values(values, 3, own_criterion).tolist() == [float(each) for each in values]


@pytest.mark.parametrize(
    "values",
    [
        np.array([math.nan, 1.0, math.inf]),
        1.0,
        np.zeros(2),
        np.zeros((3, 1)),
        np.zeros(3, complex),
        ["1", "2", "3"],
        np.array([1, 2, None]),
        None,
    ],
)
def test_any_other_values_are_refused_with_the_criterions_name(values, says):
    with says.raises(ReturnedError):
        checked_values(values, 3, own_criterion)


def test_people_are_four_finite_numbers_each(says):
    seen = observation()
    assert checked_people(seen, Own()) is seen
    with says.raises(ReturnedError):
        checked_people(seen._replace(pedestrians=np.zeros((1, 2))), Own())
    with pytest.raises(ReturnedError, match=r"Own\.seen returned None"):
        checked_people(None, Own())


@pytest.mark.parametrize(
    "changes",
    [
        {"target": np.array([math.nan, 0.0])},
        {"twist": Twist(0.0, math.inf)},
        {"odometry": None},
        {"scan": np.zeros(9)},
        {"scan": observation().scan._replace(ranges=np.array(["1.0"]))},
        {"scan": observation().scan._replace(angle_min=math.nan)},
    ],
)
def test_an_observation_that_no_navigator_can_use_is_refused(changes, says):
    seen = observation()
    assert checked_observation(seen, State(), Own()) is seen
    with says.raises(ReturnedError):
        checked_observation(seen._replace(**changes), State(), Own())


def test_a_state_that_is_nowhere_is_refused(says):
    with says.raises(ReturnedError):
        checked_observation(observation(), State(time=math.nan), Own())
