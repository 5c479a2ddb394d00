"""Criteria in one call: each has its own values, and the best candidate is that of the paper's score."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.policies.lme.score import rank
from lme.policies.lme_plus.criteria import CRITERIA, Sight, ranked
from lme.policies.lme_plus.travel import Travel, TravelConfig
from lme.types import Pose
from tests.builders import stage

WEIGHTS = np.array([1.0, 0.3, 1.0, 1000.0])


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_one_call_ranks_the_candidates_by_all_criteria(seed):
    rng, robot = np.random.default_rng(seed), stage()
    points, target, pose = rng.uniform(-2.5, 2.5, (9, 2)), rng.uniform(-4.0, 4.0, 2), Pose(0.3, -0.2, 0.7)
    field = Travel(TravelConfig(), robot, 4.0, 0.08).field(points, target, np.array(pose[:2]))
    sight = Sight(points, pose, field, robot.footprint.box, 0.08, 0.08, robot.v_max)
    pool = rng.uniform(-4.0, 4.0, (12, 2))
    features, scores, new, blocked = ranked(pool, sight.plain(), WEIGHTS, 11)
    expected = np.array([criterion(pool, sight) for criterion in CRITERIA.values()])
    np.testing.assert_array_equal(features, expected)
    best = rank(expected, WEIGHTS, 11, list(CRITERIA).index("c_o"))
    np.testing.assert_array_equal(scores, best[0])
    assert (new, blocked) == best[1:]
