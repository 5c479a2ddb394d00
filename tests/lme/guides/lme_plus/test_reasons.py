"""The sentences about decisions of LME+, whose score is a time."""

import math
import re

import numpy as np
import pytest

from lme.guides.lme.criteria import View
from lme.guides.lme.explanation import Decision, Explanation, Way, reason, reasons
from lme.guides.lme.maintenance import Choice, choose
from lme.guides.lme.score import Parameters, score
from lme.guides.lme_plus.criteria import CRITERIA
from lme.guides.lme_plus.reasons import sentence_in_seconds, with_way
from lme.worlds.world import World
from tests.lme.guides.lme_plus.test_guide_lme_plus import drive

WEIGHTS = {"a_reach": 1.0, "a_dev": 0.3, "a_rest": 1.0, "c_o": 1000.0, "d1": 0.25, "d2": 0.3}
FREE = {"a_reach": -2.0, "a_dev": 0.0, "a_rest": -6.0, "c_o": 1.0}  # 8 s to the target
WAY = Way(np.array([[1.0, 0.0], [2.0, 0.5]]), math.inf, math.inf, 0)
LEFT, RIGHT = np.array([2.0, 1.0]), np.array([2.0, -1.0])


def explained(candidate=FREE, old=None, at=LEFT, old_at=RIGHT, target=(8.0, 0.0), way=WAY, **parameters):
    """The decision between a candidate at `at` and an old subgoal, by their features where these are not FREE."""
    chosen = Parameters.from_mapping({**WEIGHTS, **parameters}, CRITERIA)
    new_features = np.array([{**FREE, **candidate}[name] for name in CRITERIA])
    features = new_features[:, None]
    scores, choice, old_features, old_score = score(features, chosen.weights), Choice.FIRST, None, None
    if old is not None:
        old_features = np.array([{**FREE, **old}[name] for name in CRITERIA])
        old_score = float(score(old_features[:, None], chosen.weights)[0])
        choice = choose(math.hypot(*old_at), old_score, scores[0], chosen.d1, chosen.d2)
    return Explanation(
        decision=Decision(np.array(at), choice, not features[3].any()),
        names=tuple(CRITERIA),
        candidates=np.array([at]),
        features=features,
        scores=scores,
        new=0,
        old=None if old is None else np.array(old_at),
        old_features=old_features,
        old_score=old_score,
        view=View(np.zeros((0, 2)), np.array(target), 0.3, np.zeros((0, 2)), None, "every"),
        sectors=np.zeros((0, 2), dtype=np.int64),
        closed=False,
        parameters=chosen,
        way=way,
        tell=sentence_in_seconds,
    )


def around(*points, route, target=(8.0, 0.0)):
    """The way of a decision among obstacle points."""
    seen = np.array(points, dtype=float).reshape(-1, 2)
    told = explained(target=target)
    return with_way(lambda: told, np.array(route, dtype=float), math.inf, seen, 0.25, 5.0).way


# --- sentences by hand -----------------------------------------------------------------------------------


def test_the_first_states_time_and_way(says):
    says(reason(explained(way=WAY._replace(obstacle=1.84, side=1))))
    says(reason(explained(way=WAY._replace(obstacle=1.84, side=0), target=(0.0, 8.0))))
    says(reason(explained(way=WAY._replace(narrow=2.31))))


def test_no_known_way_is_said(says):
    nowhere = WAY._replace(points=np.zeros((0, 2)))
    says(reason(explained(way=nowhere)))
    assert "no way" not in reason(explained(way=nowhere, target=(0.4, 0.0)))


def test_better_states_seconds_and_the_cause(says):
    way = WAY._replace(obstacle=1.84, side=1)
    slow = {"a_rest": -6.8}
    says(reason(explained(old=slow, way=way), explained(slow)))
    says(reason(explained(old=slow), explained()))
    says(reason(explained(old={"a_dev": -3.0}), explained({"a_dev": -3.0})))


def test_the_other_side_is_named_if_the_old_one_lies_there():
    way = WAY._replace(obstacle=1.84, side=1)
    slow = {"a_rest": -6.8}
    assert "passing left instead of right of" in reason(explained(old=slow, way=way))
    assert "passing left of" in reason(explained(old=slow, way=way, old_at=LEFT))
    other = way._replace(side=-1)
    assert "passing right instead of left of" in reason(explained(old=slow, at=RIGHT, old_at=LEFT, way=other))


@pytest.mark.parametrize(("before", "old"), [(1.0, 0.0), (1.0, 0.5), (0.0, 0.0)])
def test_a_lost_subgoal_is_given_up_though_the_new_one_is_slower(before, old, says):
    says(reason(explained(old={"c_o": old, "a_rest": -5.0}), explained({"c_o": before})))


def test_kept_states_seconds(says):
    says(reason(explained({"a_rest": -5.9}, old={})))
    says(reason(explained({"a_rest": -7.0}, old={})))
    says(reason(explained(old={})))
    says(reason(explained({"a_rest": -2.0, "c_o": 0.0}, old={})))
    says(reason(explained({"a_rest": -1.0}, old={}, d2=math.inf)))


def test_reached_states_the_distance(says):
    says(reason(explained({"a_rest": -5.0}, old={}, old_at=(0.0, 0.2))))
    says(reason(explained({"a_rest": -5.0}, old={}, d1=math.inf)))


def test_alike_share_a_sentence(says):
    kept = [explained({"a_rest": rest}, old={}) for rest in (-7.0, -5.9, -6.0)]
    reached = [explained(old={}, old_at=(0.0, away)) for away in (0.1, 0.2)]
    says("\n".join(text for *_, text in reasons([explained(), *kept, *reached])))
    lost = explained({"c_o": 0.0}, old={"c_o": 0.0})
    says(reasons([lost, lost])[0][2])


# --- the way ---------------------------------------------------------------------------------------------


def test_the_nearest_obstacle_on_the_straight_way_is_passed_on_a_side():
    left = [(1.0, 0.6), (2.0, 0.9), (3.0, 0.7)]
    assert around((3.0, 0.1), (2.0, -0.2), (1.0, 0.5), route=left)[2:] == (2.0, 1)
    assert around((2.0, 0.0), route=np.array(left) * (1, -1))[2:] == (2.0, -1)
    assert around((2.0, 0.0), route=[(1.0, 0.1), (2.5, 0.2)])[2:] == (2.0, 0)
    assert around((2.0, 0.0), route=[(-1.0, 0.6)])[2:] == (2.0, 1)  # back and out
    assert around((2.0, 0.0), route=np.zeros((0, 2)))[2:] == (2.0, 0)


@pytest.mark.parametrize(
    "point", [(2.0, 0.3), (-1.0, 0.0), (0.1, 0.0), (5.5, 0.0)], ids=["beside", "behind", "under", "far"]
)
def test_what_is_not_on_the_straight_way_is_no_obstacle(point):
    assert around(point, route=[(1.0, 0.0)]).obstacle == math.inf


def test_the_way_turns_with_the_target():
    way = around((0.0, 2.0), route=[(-0.7, 1.0), (-0.7, 2.5)], target=(0.0, 8.0))
    assert way[2:] == (2.0, 1)


# --- drives ----------------------------------------------------------------------------------------------

BOX = World(segments=np.array([[1.5, -0.4, 1.5, 0.9], [1.5, 0.9, 2.5, 0.9], [2.5, 0.9, 2.5, -0.4]]))


def test_a_drive_around_a_box_is_told_in_seconds():
    _, steps = drive(BOX, time_limit=3.0)
    first = reason(steps[0])
    assert re.search(r"\d\.\d s to the target, passing right of the obstacle 1\.5 m ahead", first)
    assert not any("c_o" in reason(now, before) for before, now in zip([None, *steps], steps, strict=False))
