"""Draw of a candidate by the logits of a subgoal network."""

from __future__ import annotations

import numpy as np

from lme.types import Floats


def draw(logits: Floats, rng: np.random.Generator) -> int:
    """Draw a candidate by its probability. logits: (CANDIDATES,), −inf for candidates that must not be drawn."""
    odds = np.cumsum(np.exp(logits - logits.max()))
    return int(np.searchsorted(odds, rng.random() * odds[-1], side="right"))
