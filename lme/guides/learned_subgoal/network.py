"""The subgoal network: two hidden layers, and a logit for every candidate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lme.geometry.dense import dense
from lme.guides.learned_subgoal.candidates import BEARINGS
from lme.guides.learned_subgoal.weights import LAYERS, Weights
from lme.types import Floats

SLOPE = 0.2  # of the leaky ReLU
_NONE = 1.0  # slope of no ReLU


class SubgoalPolicy:
    """The network in compiled code. weights: the arrays of `lme.guides.learned_subgoal.weights.SHAPES`."""

    def __init__(self, weights: Weights) -> None:
        self._layers = [
            (_array(weights, f"{layer}.kernel"), _array(weights, f"{layer}.bias")) for layer in LAYERS
        ]

    def logits(self, scan: Floats, free: Floats, state: Floats) -> Floats:
        """Logits (CANDIDATES,), −inf for candidates that are not free; the inputs are those of `SubgoalFeatures`."""
        ways = free.reshape(BEARINGS, -1).mean(axis=1)
        values: NDArray[np.float32] = np.concatenate((scan, ways, state)).astype(np.float32)[None]
        for kernel, bias in self._layers[:-1]:
            values = dense(values, kernel, bias, SLOPE)
        output = dense(values, *self._layers[-1], _NONE)[0].astype(np.float64)
        return np.where(free > 0.0, output, -np.inf)


def draw(logits: Floats, rng: np.random.Generator) -> int:
    """Draw a candidate by its probability."""
    odds = np.cumsum(np.exp(logits - logits.max()))
    return int(np.searchsorted(odds, rng.random() * odds[-1], side="right"))


def _array(weights: Weights, name: str) -> NDArray[np.float32]:
    return np.ascontiguousarray(weights[name], np.float32)
