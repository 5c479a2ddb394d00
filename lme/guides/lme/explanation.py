"""One step of Algorithm 1 and its explanation."""

from __future__ import annotations

from typing import NamedTuple

from lme.guides.lme.criteria import View
from lme.guides.lme.kernels import cluster
from lme.guides.lme.maintenance import Choice
from lme.guides.lme.score import Parameters
from lme.perception.scan_points import is_full_circle
from lme.types import Floats, Ints, LaserScan


class Decision(NamedTuple):
    """The outcome of one step.

    subgoal: (2,) in the robot frame [m]. blocked: no candidate is reachable.
    """

    subgoal: Floats
    choice: Choice
    blocked: bool


class Step(NamedTuple):
    """All quantities of one step; P points in the pool, C criteria.

    pool: (P, 2) the candidates and, at index `old`, the old subgoal if there is one. features: (C, P), rows
    named by `names`. scores: (P,). new: index of the best candidate. parameters: weights in the order of `names`.
    """

    decision: Decision
    names: tuple[str, ...]
    parameters: Parameters
    scan: LaserScan
    view: View
    pool: Floats
    features: Floats
    scores: Floats
    new: int
    old: int | None


class Explanation(NamedTuple):
    """All quantities behind one decision; N candidates, C criteria, M scan points, K sectors.

    candidates: (N, 2). features: (C, N), rows named by `names`. scores: (N,). new: index of the best candidate.
    old, old_features, old_score: the old subgoal in the current robot frame (2,), its (C,) features and its score;
    None at the first step. view: input of the criteria. sectors: (K, 2) first and last scan point of each;
    closed: they form one closed ring. E1, E2, A, B are in `view.blockage`. parameters: weights in the order of
    `names`.
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


def explain(step: Step) -> Explanation:
    """Separate the old subgoal from the candidates and find the sectors of the scan. Arrays are not copied."""
    has_old = step.old is not None
    sectors, closed = cluster(step.view.points, 2.0 * step.view.radius, is_full_circle(step.scan))
    return Explanation(
        decision=step.decision,
        names=step.names,
        candidates=step.pool[: step.old],
        features=step.features[:, : step.old],
        scores=step.scores[: step.old],
        new=step.new,
        old=step.pool[-1] if has_old else None,
        old_features=step.features[:, -1] if has_old else None,
        old_score=float(step.scores[-1]) if has_old else None,
        view=step.view,
        sectors=sectors,
        closed=closed,
        parameters=step.parameters,
    )
