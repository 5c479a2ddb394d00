"""Features of the candidates: as recorded, or rounded where that changes no choice.

The features of LME+ are times and angles that follow from all that the robot knows, so the page cannot compute most of
them. In full precision they would be two thirds of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.guides.lme.maintenance import Choice, choose
from lme.types import Floats
from runners.reports.explainer.packer import Packer

QUANTUM = 0.001  # [s], [rad]


def add_features(packer: Packer, reasons: Sequence[Explanation], firsts: Sequence[int]) -> None:
    """Add the features of the candidates as they are. firsts: the first candidate whose feature is added, by row."""
    for row, (name, first) in enumerate(zip(reasons[0].names, firsts, strict=True)):
        packer.add_doubles(f"feature.{name}", _written(reasons, row, first))


def add_rounded_features(packer: Packer, reasons: Sequence[Explanation], firsts: Sequence[int]) -> float:
    """Add the same features rounded to the quantum, which is returned.

    All those of steps that would then choose otherwise are added in full as well.
    """
    exact = [step for step, reason in enumerate(reasons) if not _chooses_alike(reason, firsts)]
    packer.add_integers("exact.steps", exact)
    for row, (name, first) in enumerate(zip(reasons[0].names, firsts, strict=True)):
        rounded = np.rint(np.nan_to_num(_written(reasons, row, first)) / QUANTUM)
        packer.add_integers(f"feature.{name}", rounded)
        packer.add_doubles(f"exact.{name}", _written([reasons[step] for step in exact], row, 0))
    return QUANTUM


def _written(reasons: Sequence[Explanation], row: int, first: int) -> Floats:
    return np.concatenate([np.empty(0), *(reason.features[row, first:] for reason in reasons)])


def _chooses_alike(reason: Explanation, firsts: Sequence[int]) -> bool:
    """Return whether rounded features lead to the recorded choice, in the arithmetic of `assets/score.js`.

    firsts: the first candidate whose feature is rounded, by row.
    """
    if not (np.abs(reason.features) < QUANTUM * np.iinfo(np.int32).max).all():
        return False
    weights, scores = reason.parameters.weights, np.zeros(reason.features.shape[1])
    for weight, feature, first in zip(weights, reason.features, firsts, strict=True):
        rounded = feature.copy()
        rounded[first:] = np.rint(feature[first:] / QUANTUM) * QUANTUM
        scores += weight * rounded
    best = int(np.argmax(scores))
    choice = Choice.FIRST
    if reason.old is not None and reason.old_features is not None:
        old_score = sum((weights * reason.old_features).tolist())
        parameters = reason.parameters
        choice = choose(math.hypot(*reason.old), old_score, float(scores[best]), parameters.d1, parameters.d2)
    return best == reason.new and choice == reason.decision.choice
