"""Features that are rounded in the page, where that changes no choice.

The features of LME+ are times and angles that follow from all that the robot knows, so the page cannot compute them.
In full precision they would be two thirds of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.guides.lme.maintenance import Choice, choose
from runners.reports.explainer.packer import Packer

QUANTUM = 0.001  # [s], [rad]


def add_rounded_features(packer: Packer, reasons: Sequence[Explanation]) -> float:
    """Add the features of all candidates, rounded to the quantum, which is returned.

    Those of steps that would then choose otherwise are added in full as well.
    """
    exact = [step for step, reason in enumerate(reasons) if not _chooses_alike(reason)]
    packer.add_integers("exact.steps", exact)
    for row, name in enumerate(reasons[0].names):
        features = np.concatenate([reason.features[row] for reason in reasons])
        packer.add_integers(f"feature.{name}", np.rint(np.nan_to_num(features) / QUANTUM))
        full = [reasons[step].features[row] for step in exact]
        packer.add_doubles(f"exact.{name}", np.concatenate([np.empty(0), *full]))
    return QUANTUM


def _chooses_alike(reason: Explanation) -> bool:
    """Return whether rounded features lead to the recorded choice, in the arithmetic of `assets/score.js`."""
    if not (np.abs(reason.features) < QUANTUM * np.iinfo(np.int32).max).all():
        return False
    weights, scores = reason.parameters.weights, np.zeros(reason.features.shape[1])
    for weight, feature in zip(weights, np.rint(reason.features / QUANTUM) * QUANTUM, strict=True):
        scores += weight * feature
    best = int(np.argmax(scores))
    choice = Choice.FIRST
    if reason.old is not None and reason.old_features is not None:
        old_score = sum((weights * reason.old_features).tolist())
        parameters = reason.parameters
        choice = choose(math.hypot(*reason.old), old_score, float(scores[best]), parameters.d1, parameters.d2)
    return best == reason.new and choice == reason.decision.choice
