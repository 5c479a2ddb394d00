"""One step of Algorithm 1, its quantities, and the reason for its decision as a sentence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from lme.guides.lme.criteria import View
from lme.guides.lme.maintenance import Choice
from lme.guides.lme.score import Parameters
from lme.guides.lme.surmount import cluster
from lme.perception.scan_points import is_full_circle
from lme.types import Floats, Ints, LaserScan

LEFT_OUT = 0.25  # largest share of a score difference that the unnamed terms may sum to, in absolute value
_BEST = {"c_o": 1.0, "c_t": 1.0, "a_mount": 0.0, "c_h": 1.0}  # best values of the paper's features
_FELL = {
    "c_o": "stopped being reachable",
    "c_t": "lost its free line to the target",
    "c_h": "ended up behind recent positions of the robot",
}
_NARROWED = "became reachable only with a smaller margin"  # c_o of LME+ is then 1/2
_FELL_IN_A_MOUNT = {  # by the reading of the surmount feature
    "every": "ended up off the way around the sector that now blocks the robot's way to the target",
    "hidden": "became hidden from the target behind the blocking sector",
}


class Decision(NamedTuple):
    """The outcome of one step.

    subgoal: (2,) in the robot frame [m]. blocked: no candidate is reachable.
    """

    subgoal: Floats
    choice: Choice
    blocked: bool


class Way(NamedTuple):
    """The fastest way that a guide expects, and what it goes around; distances in [m].

    points: (P, 2) in the robot frame, empty if no way is known. narrow: how far along it the first passage is that
    leaves less than the margin, inf if none. obstacle: distance of the nearest obstacle on the straight way to the
    target, inf if none is within the reach of a candidate. side: on which the way passes this obstacle, as seen from
    the robot: 1 left, −1 right, 0 if that cannot be told.
    """

    points: Floats
    narrow: float
    obstacle: float
    side: int


class Explanation(NamedTuple):
    """All quantities behind one decision; N candidates, C criteria, M scan points, K sectors.

    candidates: (N, 2). features: (C, N), rows named by `names`. scores: (N,). new: index of the best candidate.
    old, old_features, old_score: the old subgoal in the current robot frame (2,), its (C,) features and its score;
    None at the first step. view: input of the criteria. sectors: (K, 2) first and last scan point of each;
    closed: they form one closed ring. E1, E2, A, B are in `view.blockage`. parameters: weights in the order of
    `names`. way: of a guide whose score is minus a time [s], apart from c_o, such as LME+; None for other guides.
    tell: makes the sentence for decisions of such a guide as `reasons` does, from them and the decision before them.
    """

    decision: Decision
    names: tuple[str, ...]
    candidates: Floats
    features: Floats
    scores: Floats
    new: int
    old: Floats | None
    old_features: Floats | None
    old_score: float | None
    view: View
    sectors: Ints
    closed: bool
    parameters: Parameters
    way: Way | None = None
    tell: Callable[[Sequence[Explanation], Explanation | None], str] | None = None


def explain(
    decision: Decision,
    names: tuple[str, ...],
    parameters: Parameters,
    scan: LaserScan,
    view: View,
    pool: Floats,
    features: Floats,
    scores: Floats,
    new: int,
    old: int | None,
) -> Explanation:
    """Separate the old subgoal from the candidates and find the sectors of the scan. Arrays are not copied.

    pool: (P, 2) the candidates and, at index `old`, the old subgoal if there is one. features: (C, P), rows named by
    `names`. scores: (P,).
    """
    has_old = old is not None
    sectors, closed = cluster(view.points, 2.0 * view.radius, is_full_circle(scan))
    return Explanation(
        decision=decision,
        names=names,
        candidates=pool[:old],
        features=features[:, :old],
        scores=scores[:old],
        new=new,
        old=pool[-1] if has_old else None,
        old_features=features[:, -1] if has_old else None,
        old_score=float(scores[-1]) if has_old else None,
        view=view,
        sectors=sectors,
        closed=closed,
        parameters=parameters,
    )


class Term(NamedTuple):
    """Contribution w·Δf of one criterion to a score difference."""

    name: str
    value: float


def reason(current: Explanation, previous: Explanation | None = None) -> str:
    """Reason for one decision: one sentence, or two if no candidate is reachable.

    previous: the decision one control period earlier, for naming what has changed; None at the first step.
    Source: second half of Algorithm 1.
    """
    sentence = _sentence([current], previous)
    if not current.decision.blocked:
        return sentence
    outcome = "the old one stays" if current.decision.choice is Choice.KEPT else "the best of them is taken"
    return f"{sentence}. No candidate is reachable: {outcome}"


def reasons(steps: Sequence[Explanation]) -> list[tuple[int, int, str]]:
    """Return (first step, last step, reason) for all steps of an episode, in order.

    Consecutive decisions that kept the subgoal, or that replaced a reached one, share one sentence.
    """
    spans = []
    for _, group in groupby(enumerate(steps), lambda item: _group_key(*item)):
        begin, *later = [step for step, _ in group]
        end = later[-1] if later else begin
        previous = steps[begin - 1] if begin else None
        text = _shared_reason(steps[begin : end + 1]) if later else reason(steps[begin], previous)
        spans.append((begin, end, text))
    return spans


def _shared_reason(steps: Sequence[Explanation]) -> str:
    blocked = sum(step.decision.blocked for step in steps)
    note = f". No candidate was reachable at {blocked} of them" if blocked else ""
    return _sentence(steps, None) + note


def _sentence(steps: Sequence[Explanation], previous: Explanation | None) -> str:
    """Sentence for one decision, or for several that are all KEPT or all REACHED."""
    current = steps[0]
    if current.tell is not None:
        return current.tell(steps, previous)
    if len(steps) > 1:
        return _shared_sentence(steps)
    choice = current.decision.choice
    if choice is Choice.FIRST:
        return _explain_first(current)
    if choice is Choice.REACHED:
        return _explain_reached(current)
    if choice is Choice.BETTER:
        return _explain_better(current, previous)
    return f"kept: the best new one scores {_against_d2(current)}"


def difference_terms(explanation: Explanation) -> list[Term]:
    """Difference of the best candidate's score from the old subgoal's, by criterion, largest first.

    At the first step: the difference from the average of the candidates.
    """
    rival = (
        explanation.features.mean(axis=1) if explanation.old_features is None else explanation.old_features
    )
    values = explanation.parameters.weights * (explanation.features[:, explanation.new] - rival)
    terms = [Term(name, float(value)) for name, value in zip(explanation.names, values, strict=True)]
    return sorted(terms, key=lambda term: -abs(term.value))


def main_terms(terms: Sequence[Term]) -> list[Term]:
    """Fewest leading terms such that Σ|remainder| is at most LEFT_OUT of the sum of all terms."""
    tolerance = LEFT_OUT * abs(sum(term.value for term in terms))
    remainders = np.cumsum([abs(term.value) for term in reversed(terms)])[::-1]
    return [term for term, remainder in zip(terms, remainders, strict=True) if remainder > tolerance]


def _group_key(step: int, explanation: Explanation) -> Choice | int:
    """Group key: the choice if consecutive decisions share one sentence, else the step's number."""
    choice = explanation.decision.choice
    return choice if choice in (Choice.KEPT, Choice.REACHED) else step


def _shared_sentence(steps: Sequence[Explanation]) -> str:
    """One sentence for two or more decisions that are all KEPT or all REACHED."""
    if steps[0].decision.choice is Choice.KEPT:
        closest = max(steps, key=_gain)
        return f"kept for {len(steps)} steps: the best new one scored {_against_d2(closest, 'at most ')}"
    d1 = steps[0].parameters.d1
    if math.isinf(d1):
        return f"switched at {len(steps)} steps: d1 is infinite, so no subgoal is maintained"
    distance = fewest_digits(max(map(old_distance, steps)), d1)
    return (
        f"switched at {len(steps)} steps: the old one was reached, at most {distance} m away (d1 {d1:.6g} m)"
    )


def _explain_first(explanation: Explanation) -> str:
    terms = difference_terms(explanation)
    lead, count = sum(term.value for term in terms), len(explanation.candidates)
    if count == 1:
        return "first subgoal: the only candidate"
    if lead <= 0.0:
        return f"first subgoal: no better than the rest of {count} candidates"
    terms_text = _list_terms(main_terms(terms))
    return f"first subgoal: the best of {count} candidates, {_text(lead)} above their average, {terms_text}"


def _explain_reached(explanation: Explanation) -> str:
    d1, gain = explanation.parameters.d1, _gain(explanation)
    replacement = f"the best new one, which scores {_relative_score(gain)}, takes its place"
    if math.isinf(d1):
        return f"switched: d1 is infinite, so no subgoal is maintained; {replacement}"
    distance = fewest_digits(old_distance(explanation), d1)
    return f"switched: the old one is reached, {distance} m away (d1 {d1:.6g} m); {replacement}"


def _explain_better(current: Explanation, previous: Explanation | None) -> str:
    leading_terms = main_terms(difference_terms(current))
    change = _describe_changes(current, previous, leading_terms)
    d2 = current.parameters.d2
    scores = f"new subgoal scores {fewest_digits(_gain(current), d2)} higher (d2 {d2:.6g})"
    return f"switched: {scores}, {_list_terms(leading_terms)}{f'; the old one {change}' if change else ''}"


def _against_d2(explanation: Explanation, at_most: str = "") -> str:
    gain, d2 = _gain(explanation), explanation.parameters.d2
    if gain <= 0.0:
        return f"{at_most.replace('most', 'least') if gain else at_most}{_relative_score(gain)}"
    if math.isinf(d2):
        return f"{at_most}{_text(gain)} higher, and d2 is infinite"
    return f"{at_most}{fewest_digits(gain, d2)} higher, {_text(d2 - gain)} short of d2 ({d2:.6g})"


def old_distance(explanation: Explanation) -> float:
    """Distance from the robot to the old subgoal [m]."""
    assert explanation.old is not None
    return math.hypot(explanation.old[0], explanation.old[1])


def _gain(explanation: Explanation) -> float:
    """Score of the best candidate minus that of the old subgoal."""
    assert explanation.old_score is not None
    return float(explanation.scores[explanation.new] - explanation.old_score)


def chosen_features(explanation: Explanation) -> Floats:
    """Features (C,) of the subgoal that was chosen."""
    if explanation.decision.choice is Choice.KEPT and explanation.old_features is not None:
        return explanation.old_features
    return explanation.features[:, explanation.new]


def _describe_changes(
    current: Explanation, previous: Explanation | None, leading_terms: Sequence[Term]
) -> str:
    """Describe how the old subgoal's features fell since the last step, for criteria that favour the new one."""
    if previous is None or current.old_features is None:
        return ""
    features = chosen_features(previous)
    words = {**_FELL, "a_mount": _FELL_IN_A_MOUNT[current.view.surmount]}
    falls = []
    for term in leading_terms:
        row = current.names.index(term.name)
        falls.append(
            _describe_fall(
                term, features[row], current.old_features[row], current.parameters.weights[row], words
            )
        )
    if _FELL_IN_A_MOUNT["hidden"] in falls:  # it implies the lost line to the target
        falls = [fall for fall in falls if fall != _FELL["c_t"]]
    *others, last = [fall for fall in falls if fall] or [""]
    return f"{', '.join(others)} and {last}" if others else last


def _describe_fall(
    term: Term, previous: float, current: float, weight: float, words: Mapping[str, str]
) -> str:
    """Describe how the old subgoal fell in a criterion, if its loss is at least half of the term; else ""."""
    loss = weight * (previous - current)
    if term.value <= 0.0 or loss < term.value / 2:
        return ""
    if term.name == "c_o":
        return _NARROWED if current > 0.0 else words["c_o"]
    return words[term.name] if previous == _BEST.get(term.name) else f"fell by {_text(loss)} in {term.name}"


def _list_terms(terms: Sequence[Term]) -> str:
    return "mainly " + ", ".join(
        f"{term.name} {'+' if term.value > 0 else '−'}{_text(abs(term.value), whole_from=math.inf)}"
        for term in terms
    )


def _relative_score(gain: float) -> str:
    return f"{_text(abs(gain))} {'higher' if gain > 0 else 'lower'}" if gain else "the same"


def _text(value: float, whole_from: float = 100.0) -> str:
    """Format a positive number with few digits, without decimals if it is at least `whole_from`."""
    if value < 0.001:
        return "less than 0.001"
    return f"{value:.2g}" if value < 1.0 else f"{value:.{0 if value >= whole_from else 1}f}"


def fewest_digits(value: float, bound: float) -> str:
    """Format a number with the fewest digits that keep it on its side of the bound."""
    digits = 0 if value >= 100.0 else 1 if value >= 1.0 else 2
    while digits < 9 and np.sign(round(value, digits) - bound) != np.sign(value - bound):
        digits += 1
    return f"{value:.{digits}f}"
