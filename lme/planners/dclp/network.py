"""Policy network of DRL-DCLP: shared layers over directions, a maximum, and a mixture of actions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.geometry.dense import dense
from lme.planners.dclp.weights import COMPONENTS, LAYERS, MIXTURE, Weights
from lme.types import Floats

SLOPE = 0.2  # of the leaky ReLU, TensorFlow's default
_NONE = 1.0  # slope of no ReLU
LEAST_DISTANCE = 1e-8  # [m] of distance plus α
DISTANCE = 2  # column of the distance in a direction's inputs


class Mixture(NamedTuple):
    """Gaussian components of the action. logits: (4,); means: (4, 2) in (−1, 1), of v and ω."""

    logits: Floats
    means: Floats


class DclpPolicy:
    """Published network in compiled code: 1 M multiplications.

    weights: the arrays of `lme.planners.dclp.weights.SHAPES`.
    """

    def __init__(self, weights: Weights) -> None:
        self._alpha = float(weights["alpha"])
        layers = [(_array(weights, f"{layer}.kernel"), _array(weights, f"{layer}.bias")) for layer in LAYERS]
        self._shared, self._joint, self._output = layers[:3], layers[3:-1], layers[-1]

    def mixture(self, directions: Floats, state: Floats) -> Mixture:
        """Return the components of the action.

        directions: (90, 6) of cos, sin, distance [m], length ahead, length behind, half width [m]. state: (8,) of
        distance and bearing of the target, v, ω, and the limits of v, ω and their accelerations, in SI units.
        """
        features = directions.astype(np.float32)
        features[:, DISTANCE] = 1.0 / np.maximum(directions[:, DISTANCE] + self._alpha, LEAST_DISTANCE)
        for kernel, bias in self._shared:
            features = dense(features, kernel, bias, SLOPE)
        joint: NDArray[np.float32] = np.concatenate((features.max(axis=0), state.astype(np.float32)))[None]
        for kernel, bias in self._joint:
            joint = dense(joint, kernel, bias, SLOPE)
        kernel, bias = self._output
        output = dense(joint, kernel, bias, _NONE).astype(np.float64).reshape(COMPONENTS, MIXTURE)
        return Mixture(output[:, 0], np.tanh(output[:, 1:3]))


def draw(mixture: Mixture, rng: np.random.Generator) -> Floats:
    """Draw a component by its probability and return its mean: (2,) of v and ω in (−1, 1).

    The authors' deterministic policy draws the component, too, and omits only the noise about its mean.
    """
    odds = np.exp(mixture.logits - mixture.logits.max())
    odds = np.cumsum(odds)
    chosen = int(np.searchsorted(odds, rng.random() * odds[-1], side="right"))
    means: Floats = mixture.means[min(chosen, COMPONENTS - 1)]
    return means


def _array(weights: Weights, name: str) -> NDArray[np.float32]:
    return np.ascontiguousarray(weights[name], np.float32)
