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
from lme.types import Pose
from tests.builders import stage

WEIGHTS = np.array([1.0, 0.3, 1.0, 1000.0])


def test_a_dev_counts_the_turn_to_a_place_and_the_turn_at_it():
    robot, target = stage(), np.array([-4.0, 0.0])
    field = Travel(load_settings("guide/lme_plus").travel, robot, 8.0, 0.08).field(
        np.empty((0, 2)), target, np.zeros(2)
    )
    sight = Perception(np.empty((0, 2)), Pose(0.0, 0.0, 0.0), field, robot.footprint.box, 0.08, robot.v_max)
    ahead, behind, target_itself = CRITERIA["a_dev"](np.array([[0.15, 0.0], [-1.0, 0.0], target]), sight)
    assert ahead == pytest.approx(-math.pi, abs=0.1)  # the turn is put off
    assert behind == pytest.approx(-math.pi, abs=0.1)  # it comes first
    assert target_itself == -math.pi


@given(st.integers(0, 10**6))
def test_one_call_ranks_the_candidates_by_all_criteria(seed):
    rng, robot = np.random.default_rng(seed), stage()
    points, target, pose = rng.uniform(-2.5, 2.5, (9, 2)), rng.uniform(-4.0, 4.0, 2), Pose(0.3, -0.2, 0.7)
    field = Travel(load_settings("guide/lme_plus").travel, robot, 4.0, 0.08).field(
        points, target, np.array(pose[:2])
    )
    sight = Perception(points, pose, field, robot.footprint.box, 0.08, robot.v_max)
    pool = rng.uniform(-4.0, 4.0, (12, 2))
    features, scores, new, blocked = ranked(pool, sight.plain(), WEIGHTS, 11)
    expected = np.array([criterion(pool, sight) for criterion in CRITERIA.values()])
    np.testing.assert_array_equal(features, expected)
    best = rank(expected, WEIGHTS, 11, list(CRITERIA).index("c_o"))
    np.testing.assert_array_equal(scores, best[0])
    assert (new, blocked) == best[1:]
