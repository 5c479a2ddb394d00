"""The sentences say what was decided, with the numbers that decided it."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.guides.lme.criteria import View
from lme.guides.lme.explanation import (
    LEFT_OUT,
    Decision,
    Explanation,
    difference_terms,
    main_terms,
    reason,
    reasons,
)
from lme.guides.lme.guide import PAPER_CRITERIA, LocalMinimumEscaper
from lme.guides.lme.maintenance import Choice, choose
from lme.guides.lme.score import CRITERIA, Parameters, score
from tests.builders import PUBLISHED, escape, escaper, only, stage, wander

FREE = {"a_close": -4.0, "a_dev": 0.0, "c_o": 1.0, "c_t": 1.0, "a_mount": 0.0, "c_h": 1.0}
VIEW = View(np.zeros((0, 2)), np.array([4.0, 0.0]), 0.2, np.zeros((0, 2)), None, "every")


def explained(candidates, old=None, at=(2.0, 0.0), names=CRITERIA, surmount="every", **parameters):
    """The decision among candidates, and the old subgoal at `at`, given by their features where not FREE."""
    chosen = Parameters.from_mapping({**PUBLISHED, **parameters}, names)
    features = np.array([[{**FREE, **one}[name] for one in candidates] for name in names])
    scores = score(features, chosen.weights)
    new, choice, old_features, old_score = int(np.argmax(scores)), Choice.FIRST, None, None
    if old is not None:
        old_features = np.array([{**FREE, **old}[name] for name in names])
        old_score = float(score(old_features[:, None], chosen.weights)[0])
        choice = choose(math.hypot(*at), old_score, scores[new], chosen.d1, chosen.d2)
    return Explanation(
        decision=Decision(np.array(at), choice, not features[names.index("c_o")].any()),
        names=tuple(names),
        candidates=np.zeros((len(candidates), 2)),
        features=features,
        scores=scores,
        new=new,
        old=None if old is None else np.array(at, dtype=float),
        old_features=old_features,
        old_score=old_score,
        view=VIEW._replace(surmount=surmount),
        sectors=np.zeros((0, 2), dtype=np.int64),
        closed=False,
        parameters=chosen,
    )


# --- sentences by hand -----------------------------------------------------------------------------------


def test_better_names_the_term_and_what_befell_the_old_one(says):
    before = explained([{}])
    now = explained([{}], old={"c_t": 0.0})
    says(reason(now, before))


def test_losing_c_o_from_a_small_margin_reads_as_stopped_being_reachable(says):
    now = explained([{}], old={"c_o": 0.0})
    says(reason(now, explained([{"c_o": 0.5}])))


def test_a_criterion_that_the_old_subgoal_never_met_is_not_a_change(says):
    before = explained([{"c_t": 0.0}])
    now = explained([{}], old={"c_t": 0.0})
    says(reason(now, before))
    assert reason(now, None) == reason(now, before)


@pytest.mark.parametrize(
    "old",
    [
        {"c_o": 0.0},
        {"c_o": 0.5},
        {"a_mount": -3.0},
        {"c_h": 0.0, "c_t": 0.0},
    ],
    ids=str,
)
def test_every_fall_of_a_criterion_has_a_text(old, says):
    says(reason(explained([{}], old=old), explained([{}])))


def test_the_reason_for_a_loss_in_a_mount_depends_on_the_surmount_reading(says):
    """As printed, the sector hides the target from it: that it lost its line to the target goes without saying."""
    before, old = explained([{}]), {"a_mount": -3.0, "c_t": 0.0}
    says(reason(explained([{}], old=old, surmount="hidden"), before))
    says(reason(explained([{}], old=old), before))


def test_the_features_of_a_kept_subgoal_are_those_of_the_old_one():
    """Kept at the step before: what fell since is measured from the old one there, not from that step's best."""
    kept = explained([{"c_h": 0.0}], old={"c_t": 0.0})
    assert kept.decision.choice is Choice.KEPT
    now = explained([{}], old={"c_t": 0.0})
    assert "the old one" not in reason(now, kept)


def test_a_change_that_does_not_speak_for_the_new_one_goes_unsaid(says):
    """The old one lost its line to the target, and so has the new one none: c_o decides."""
    now = explained([{"c_t": 0.0}], old={"c_t": 0.0, "c_o": 0.0})
    says(reason(now, explained([{}])))


def test_a_weight_of_zero_says_nothing():
    now = explained([{}], old={"c_t": 0.0, "c_o": 0.0}, c_t=0.0)
    assert "c_t" not in reason(now, explained([{}], c_t=0.0))
    assert "line to the target" not in reason(now, explained([{}], c_t=0.0))


def test_terms_against_the_choice_are_named_where_they_weigh():
    now = explained([{"c_h": 0.0}], old={"c_t": 0.0, "a_mount": -1.6})
    assert "mainly c_t +205.8, a_mount +141.9, c_h −134.9" in reason(now, None)
    assert "recent positions" not in reason(now, explained([{}]))  # the old one lost nothing by c_h


def test_reached_states_the_distance_and_d1(says):
    says(reason(explained([{}], old={"a_close": -5.0}, at=(0.3, 0.4)), None))


def test_the_reason_says_that_nothing_is_maintained(says):
    text = reason(explained([{"a_close": -5.0}], old={}, d1=math.inf), None)
    says(text)
    assert "scores 1.5 lower" in text


@pytest.mark.parametrize(
    ("candidate", "parameters"),
    [
        ({}, {}),
        ({"a_close": -14.0}, {}),
        ({"a_close": 26.0}, {}),
        ({"a_close": 996.0}, {"d2": math.inf}),
    ],
    ids=str,
)
def test_kept_says_how_far_it_was_from_switching(candidate, parameters, says):
    says(reason(explained([candidate], old={}, **parameters), None))


def test_blocked_says_what_stands(says):
    none = {"c_o": 0.0, "a_close": -3.0}
    says(reason(explained([none, {"c_o": 0.0}]), None))
    says(reason(explained([none], old={}), None))


def test_the_first_is_held_against_the_average(says):
    # Scores differ by c_o alone, so the best of two stands half its weight above their mean.
    says(reason(explained([{"c_o": 0.0}, {}]), None))
    says(reason(explained([{}]), None))
    says(reason(explained([{}, {}]), None))


def test_a_criterion_of_ones_own_reads_as_well(says):
    names = (*CRITERIA, "quiet")
    parameters = {"names": names, "quiet": 100.0}
    before = explained([{"quiet": 0.9}], **parameters)
    now = explained([{"quiet": 3.0}], old={"quiet": -0.5}, **parameters)
    says(reason(now, before))  # of which the old one itself lost 140, less than half
    now = explained([{"quiet": 1.5}], old={"quiet": -0.9}, **parameters)
    says(reason(now, before))


def test_decisions_alike_share_a_sentence(says):
    kept = [explained([{"a_close": near}], old={}) for near in (-5.0, 26.0, -4.0)]
    better, worse = explained([{}], old={"c_o": 0.0}), explained([{"a_close": -5.0}], old={})
    reached = [explained([{}], old={}, at=(0.0, away)) for away in (0.1, 0.5, 0.2)]
    steps = [explained([{}]), *kept, better, better, worse, worse, *reached, *kept[:1]]
    says("\n".join(f"{first} to {last}: {text}" for first, last, text in reasons(steps)))
    assert reasons([]) == []


def test_alike_without_maintenance_or_a_way(says):
    no_maintenance = [explained([{}], old={}, d1=math.inf)] * 4
    says(reasons(no_maintenance)[0][2])
    none = explained([{"c_o": 0.0}], old={})
    says(reasons([none, none, explained([{}], old={})])[0][2])


# --- what always holds -----------------------------------------------------------------------------------

VALUES = st.floats(-20.0, 20.0, allow_subnormal=False)
FEATURES = st.fixed_dictionaries(
    {name: st.sampled_from([0.0, 1.0]) if name.startswith("c_") else VALUES for name in CRITERIA}
)
DECISIONS = st.builds(
    explained,
    st.lists(FEATURES, min_size=1, max_size=6),
    st.none() | FEATURES,
    st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 2.0)),
    d1=st.floats(0.0, 3.0) | st.just(math.inf),
    d2=st.floats(0.0, 400.0) | st.just(math.inf),
)


@given(DECISIONS)
def test_the_terms_sum_to_the_difference_and_the_named_ones_to_most_of_it(now):
    rival = now.scores.mean() if now.old_score is None else now.old_score
    difference = now.scores[now.new] - rival
    terms = difference_terms(now)
    assert sum(term.value for term in terms) == pytest.approx(difference, abs=1e-9)
    named = sum(term.value for term in main_terms(terms))
    assert abs(difference - named) <= LEFT_OUT * abs(difference) + 1e-9


@given(DECISIONS, st.none() | DECISIONS)
def test_the_verdict_is_the_decision_and_its_numbers_stand_on_their_side(now, before):
    text, choice = reason(now, before), now.decision.choice
    verdict = {Choice.FIRST: "first subgoal: ", Choice.KEPT: "kept: "}.get(choice, "switched: ")
    assert text.startswith(verdict)
    assert ("No candidate is reachable" in text) == now.decision.blocked
    assert "-0" not in text.replace("e-0", "")
    assert "nan" not in text
    if choice is Choice.BETTER:
        gain, d2 = map(float, re.search(r"scores (\S+) higher \(d2 (\S+)\)", text).groups())
        assert gain > d2 - 1e-4
    if choice is Choice.REACHED and math.isfinite(now.parameters.d1):
        away, d1 = map(float, re.search(r"reached, (\S+) m away \(d1 (\S+) m\)", text).groups())
        assert away < d1 + 1e-5


def test_every_decision_of_a_drive_has_its_reason():
    made, before, texts = escaper(), None, []
    for view in [*escape(), *wander(15)[0]]:
        decision, now = made.decide(view), made.explanation()
        texts.append(reason(now, before))
        verdict = "switched: " if decision.choice.switched else "kept: "
        assert texts[-1].startswith(verdict if before else "first subgoal: the best of")
        before = now
    assert len(set(texts)) > 20


def test_criteria_of_ones_own_from_the_escaper():
    """Weights are in the order of the names, whatever that is."""
    criteria = {"ahead": lambda candidates, view: candidates[:, 0], **PAPER_CRITERIA}
    made = LocalMinimumEscaper(
        stage(), {**only(c_o=1.0), "ahead": 50.0}, load_settings("guide/lme"), criteria
    )
    made.decide(escape()[0])
    text = reason(made.explanation(), None)
    assert "mainly ahead +" in text
