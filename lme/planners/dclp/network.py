"""Answer of DRL-DCLP's network: the components of an action, and the draw of one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lme.planners.dclp.weights import COMPONENTS
from lme.types import Floats


class Mixture(NamedTuple):
    """Gaussian components of the action. logits: (4,); means: (4, 2) in (−1, 1), of v and ω."""

    logits: Floats
    means: Floats


def draw(mixture: Mixture, rng: np.random.Generator) -> Floats:
    """Draw a component by its probability and return its mean: (2,) of v and ω in (−1, 1).

    The authors' deterministic policy draws the component, too, and omits only the noise about its mean.
    """
    odds = np.exp(mixture.logits - mixture.logits.max())
    odds = np.cumsum(odds)
    chosen = int(np.searchsorted(odds, rng.random() * odds[-1], side="right"))
    means: Floats = mixture.means[min(chosen, COMPONENTS - 1)]
    return means
