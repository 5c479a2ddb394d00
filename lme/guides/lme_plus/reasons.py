"""The reason for a decision of LME+ as a sentence: expected times in seconds, and what the fastest way goes around."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from lme.guides.lme.explanation import Explanation, Way, chosen_features, fewest_digits, old_distance
from lme.guides.lme.maintenance import Choice
from lme.types import Floats

_SIDES = {1: "left", -1: "right"}
_AHEAD = math.radians(30.0)  # bearings of the target up to this one count as ahead
_EQUAL = 0.05  # [s] times that differ by less count as equal
_PART = 0.5  # share of a difference from which a cause is named
# What became of a subgoal, and what is true of it, by whether it can still be reached with a smaller margin
_FELL = {False: "stopped being reachable", True: "became reachable only with a smaller margin"}
_LESS_REACHABLE = {False: "is not reachable", True: "is reachable only with a smaller margin"}


def with_way(
    told: Callable[[], Explanation],
    route: Floats,
    narrow: float,
    points: Floats,
    half_width: float,
    reach: float,
) -> Explanation:
    """Complete an explanation with the fastest way and with sentences in seconds.

    route (P, 2), narrow: see `Way`. points (M, 2): known obstacle points in the robot frame. half_width: of the robot.
    reach: greatest distance of a candidate [m].
    """
    explanation = told()
    # Obstacle points on the straight way to the target, in front of the robot: how far along it, and to its left.
    target = explanation.view.target
    distance = math.hypot(*target.tolist())
    along, left = _beside(points, target)
    in_way = (np.abs(left) < half_width) & (along > half_width) & (along < min(distance, reach))
    obstacle = float(along[in_way].min()) if in_way.any() else math.inf
    # The side of the first place on the way that is past the obstacle; if none is, of the last place.
    side = 0
    if len(route) and math.isfinite(obstacle):
        route_along, route_left = _beside(route, target)
        past = np.flatnonzero(route_along >= obstacle)
        side = _side(float(route_left[past[0] if len(past) else -1]), half_width)
    return explanation._replace(way=Way(route, narrow, obstacle, side), tell=sentence_in_seconds)


def sentence_in_seconds(steps: Sequence[Explanation], previous: Explanation | None) -> str:
    """Sentence for one decision, or for several that are all KEPT or all REACHED.

    previous: the decision before the first of them.
    """
    current, count = steps[0], len(steps)
    choice, d1 = current.decision.choice, current.parameters.d1
    if choice is Choice.FIRST:
        number = len(current.candidates)
        best = f"the best of {number} candidates" if number > 1 else "the only candidate"
        return f"first subgoal: {best}, {_expectation(current)}"
    if choice is Choice.REACHED:
        at_steps = f" at {count} steps" if count > 1 else ""
        end = _expectation(steps[-1])
        if math.isinf(d1):
            return f"switched{at_steps}: d1 is infinite, so no subgoal is maintained; {end}"
        distance = fewest_digits(max(map(old_distance, steps)), d1)
        reached = f"was reached, at most {distance}" if count > 1 else f"is reached, {distance}"
        return f"switched{at_steps}: the old one {reached} m away (d1 {d1:.6g} m); {end}"
    if choice is Choice.BETTER:
        return _explain_better(current, previous)
    return f"kept for {count} steps: {_explain_kept(steps)}" if count > 1 else f"kept: {_explain_kept(steps)}"


def expected_time(explanation: Explanation, features: Floats) -> float:
    """Time to the target by way of a subgoal with these features (C,): minus its score without c_o [s]."""
    values = explanation.parameters.weights * features
    return -float(sum(value for name, value in zip(explanation.names, values, strict=True) if name != "c_o"))


def _explain_better(current: Explanation, previous: Explanation | None) -> str:
    old, new = current.old_features, current.features[:, current.new]
    assert old is not None
    gain, d2 = expected_time(current, old) - expected_time(current, new), current.parameters.d2
    row = current.names.index("c_o")
    weight, end = current.parameters.weights[row], _expectation(current)
    # The old one is less reachable than the new one.
    if weight * (new[row] - old[row]) > 0.0:
        fell = previous is not None and chosen_features(previous)[row] > old[row]
        change = (_FELL if fell else _LESS_REACHABLE)[bool(old[row])]
        return f"switched: the old one {change}; the new one is {_faster(gain)}: {end}"
    # The new one is faster, perhaps because the way on from the old one has become longer, or because it turns less.
    turned = current.names.index("a_dev")
    by_turning = current.parameters.weights[turned] * (new[turned] - old[turned])
    longer = 0.0
    if previous is not None:
        rest = current.names.index("a_rest")
        longer = current.parameters.weights[rest] * (chosen_features(previous)[rest] - old[rest])
    cause = ""
    if longer >= _PART * gain:
        cause = f", since the way on from that one has become {_seconds(longer)} longer"
    elif by_turning >= _PART * gain:
        cause = ", mostly by turning less"
    return f"switched: {fewest_digits(gain, d2)} s faster than the old one (d2 {d2:.6g} s){cause}: {end}"


def _explain_kept(steps: Sequence[Explanation]) -> str:
    """Compare the new candidate that came nearest to replacing the old subgoal with it."""
    nearest = max(steps, key=lambda step: step.scores[step.new] - step.old_score)
    old, new = nearest.old_features, nearest.features[:, nearest.new]
    assert old is not None
    row, d2 = nearest.names.index("c_o"), nearest.parameters.d2
    gain = expected_time(nearest, old) - expected_time(nearest, new)
    was, most = ("was", "at most ") if len(steps) > 1 else ("is", "")
    if nearest.parameters.weights[row] * (old[row] - new[row]) > 0.0:
        return f"the best new one {_LESS_REACHABLE[bool(new[row])].replace('is', was, 1)}"
    if gain < _EQUAL:
        least = most.replace("most", "least") if gain <= -_EQUAL else most
        return f"the best new one {was} {least}{_faster(gain)}"
    bound = "and d2 is infinite" if math.isinf(d2) else f"less than d2 ({d2:.6g} s)"
    return f"the best new one {was} {most}{fewest_digits(gain, d2)} s faster, {bound}"


def _expectation(explanation: Explanation) -> str:
    """Describe the expected time to the target by way of the new subgoal, and the fastest way."""
    way, target = explanation.way, explanation.view.target
    assert way is not None
    time = f"{_seconds(expected_time(explanation, explanation.features[:, explanation.new]))} to the target"
    if not len(way.points) and math.hypot(*target.tolist()) > 1.0:
        return f"{time} in a straight line, since no way there is known"
    parts = []
    if math.isfinite(way.obstacle):
        ahead = abs(math.atan2(target[1], target[0])) <= _AHEAD
        where = f"the obstacle {way.obstacle:.1f} m {'ahead' if ahead else 'away in its direction'}"
        passing = f"passing {_SIDES[way.side]}{_instead(explanation)} of" if way.side else "around"
        parts.append(f"{passing} {where}")
    if math.isfinite(way.narrow):
        parts.append(f"through a passage that leaves less than the margin, {way.narrow:.1f} m on")
    return ", ".join([time, *parts])


def _instead(explanation: Explanation) -> str:
    """Return " instead of SIDE" if the old subgoal lies on the other side of the straight way than the new one."""
    way, old, target = explanation.way, explanation.old, explanation.view.target
    assert way is not None
    if old is None:
        return ""
    pair = np.array([explanation.candidates[explanation.new], old])
    new_side, old_side = (_side(float(left), explanation.view.radius) for left in _beside(pair, target)[1])
    if new_side != way.side or old_side != -way.side:
        return ""
    return f" instead of {_SIDES[old_side]}"


def _beside(points: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Distances (N,) of points (N, 2) along the straight way to the target, and to its left [m]."""
    distance = math.hypot(*target.tolist())
    ahead = target / distance if distance > 0.0 else np.array([1.0, 0.0])
    return points @ ahead, points @ np.array([-ahead[1], ahead[0]])


def _side(left: float, least: float) -> int:
    """Side of a place that is `left` [m] to the left of the straight way; 0 if it is nearer to that than `least`."""
    return 0 if abs(left) < least else 1 if left > 0.0 else -1


def _faster(gain: float) -> str:
    return (
        "as fast" if abs(gain) < _EQUAL else f"{_seconds(abs(gain))} {'faster' if gain > 0.0 else 'slower'}"
    )


def _seconds(time: float) -> str:
    """Format a time: to a tenth of a second, from 100 s on to a second."""
    return f"{time:.{0 if time >= 100.0 else 1}f} s"
