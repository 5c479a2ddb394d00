"""Criteria in one call: each has its own values, and the best candidate is that of the paper's score."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.guides.lme.score import rank
from lme.guides.lme_plus.criteria import CRITERIA, Perception, ranked
from lme.guides.lme_plus.travel import Travel
from tests.builders import stage

WEIGHTS = np.array([1.0, 0.3, 1.0, 1000.0])


def sight_of(points, target, pose, reach):
    """What the criteria are given, in the types that they are compiled for."""
    robot, settings = stage(), load_settings("guide/lme_plus").travel
    field = Travel(settings, robot, reach, 0.08).field(points, target, np.array(pose[:2]))
    return Perception(
        points, pose, field._replace(grid=(*field.grid,)), robot.footprint.box, 0.08, robot.v_max
    )


def test_a_dev_counts_the_turn_to_a_place_and_the_turn_at_it():
    target = np.array([-4.0, 0.0])
    sight = sight_of(np.empty((0, 2)), target, (0.0, 0.0, 0.0), 8.0)
    ahead, behind, target_itself = CRITERIA["a_dev"](np.array([[0.15, 0.0], [-1.0, 0.0], target]), sight)
    assert ahead == pytest.approx(-math.pi, abs=0.1)  # the turn is put off
    assert behind == pytest.approx(-math.pi, abs=0.1)  # it comes first
    assert target_itself == -math.pi


@given(st.integers(0, 10**6))
def test_one_call_ranks_the_candidates_by_all_criteria(seed):
    rng = np.random.default_rng(seed)
    points, target = rng.uniform(-2.5, 2.5, (9, 2)), rng.uniform(-4.0, 4.0, 2)
    sight = sight_of(points, target, (0.3, -0.2, 0.7), 4.0)
    pool = rng.uniform(-4.0, 4.0, (12, 2))
    features, scores, new, blocked = ranked(pool, sight.plain(), WEIGHTS, 11)
    expected = np.array([criterion(pool, sight) for criterion in CRITERIA.values()])
    np.testing.assert_array_equal(features, expected)
    best = rank(expected, WEIGHTS, 11, list(CRITERIA).index("c_o"))
    np.testing.assert_array_equal(scores, best[0])
    assert (new, blocked) == best[1:]
