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
    ("guidance", "said"),
    [
        (None, "None: must be an lme.Guidance"),
        ((HERE, None), "must be an lme.Guidance"),
        (Guidance(np.array([math.nan, 1.0])), "a subgoal of which 1 of 2 numbers are not finite"),
        (Guidance(np.zeros(3)), r"a subgoal of shape \(3,\): .* of shape \(2,\)"),
        (Guidance(np.zeros((1, 2))), r"a subgoal of shape \(1, 2\)"),
        (Guidance(["1", "2"]), "a subgoal .* real numbers"),
        (Guidance(np.array([1j, 0.0])), "a subgoal .* real numbers"),
        (Guidance(None), "a subgoal None"),
        (Guidance([[1.0], [1.0, 2.0]]), "a subgoal .* real numbers"),
        (
            Guidance(HERE, np.array([[0.0, 0.0], [math.inf, math.nan]])),
            "the path of which 2 of 4 numbers are not finite",
        ),
        (Guidance(HERE, np.zeros((3, 3))), r"the path of shape \(3, 3\): .* of shape \(N, 2\)"),
        (Guidance(HERE, np.empty((0, 2))), "a path without points"),
        (Guidance(HERE, points=np.array([[math.nan, 0.0]])), "the points of which 1 of 2"),
        (Guidance(HERE, way=np.zeros(2)), r"the way of shape \(2,\)"),
        (Guidance(HERE, None, "no"), "switched='no': must be True or False"),
        (Guidance(HERE, None, False, math.nan), "blocked=nan: must be True or False"),
    ],
)
def test_any_other_guidance_is_refused_with_the_guides_name(guidance, said):
    with pytest.raises(ReturnedError, match=rf"^{__name__}\.Own\.guide returned .*{said}"):
        checked_guidance(guidance, Own())


@pytest.mark.parametrize("values", [[1, 2, 3], np.array([True, False, True]), np.array([1.0, -2.0, 0.5])])
def test_a_number_for_each_candidate_is_what_a_criterion_gives(values):
    assert checked_values(values, 3, own_criterion).tolist() == [float(each) for each in values]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.array([math.nan, 1.0, math.inf]), "of which 2 of 3 numbers are not finite"),
        (1.0, r"of shape \(\)"),
        (np.zeros(2), r"of shape \(2,\): .* of shape \(3,\)"),
        (np.zeros((3, 1)), r"of shape \(3, 1\)"),
        (np.zeros(3, complex), "complex128|j"),
        (["1", "2", "3"], "real numbers"),
        (np.array([1, 2, None]), "real numbers"),
        (None, "None"),
    ],
)
def test_any_other_values_are_refused_with_the_criterions_name(values, said):
    with pytest.raises(ReturnedError, match=rf"^{__name__}\.own_criterion returned values .*({said})"):
        checked_values(values, 3, own_criterion)


def test_people_are_four_finite_numbers_each():
    seen = observation()
    assert checked_people(seen, Own()) is seen
    with pytest.raises(ReturnedError, match=r"Own\.seen returned pedestrians of shape \(1, 2\)"):
        checked_people(seen._replace(pedestrians=np.zeros((1, 2))), Own())
    with pytest.raises(ReturnedError, match=r"Own\.seen returned None"):
        checked_people(None, Own())


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"target": np.array([math.nan, 0.0])}, "a target of which 1 of 2"),
        ({"twist": Twist(0.0, math.inf)}, "a twist of which 1 of 2"),
        ({"odometry": None}, "an odometry None"),
        ({"scan": np.zeros(9)}, "must be an lme.LaserScan"),
        ({"scan": observation().scan._replace(ranges=np.array(["1.0"]))}, "ranges"),
        ({"scan": observation().scan._replace(angle_min=math.nan)}, "angles"),
    ],
)
def test_an_observation_that_no_navigator_can_use_is_refused(changes, said):
    seen = observation()
    assert checked_observation(seen, State(), Own()) is seen
    with pytest.raises(ReturnedError, match=rf"^{__name__}\.Own returned .*{said}"):
        checked_observation(seen._replace(**changes), State(), Own())


def test_a_state_that_is_nowhere_is_refused():
    with pytest.raises(ReturnedError, match=r"Own returned a state of which 1 of 4 numbers are not finite"):
        checked_observation(observation(), State(time=math.nan), Own())
