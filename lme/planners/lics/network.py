"""LiCS network: a small transformer from a sweep and the direction of the goal to a velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.geometry.dense import dense
from lme.inputs.array_file import Arrays
from lme.planners.lics.kernels import Singles, added_and_normed, attention
from lme.planners.lics.weights import DECODER, ENCODER, GOAL, HEADS, LAYERS, PATCHES, WIDTH
from lme.types import Floats

_RELU, _LINEAR = 0.0, 1.0  # slopes
_NO_BIAS = np.zeros(WIDTH, np.float32)


class _Dense(NamedTuple):
    """A fully connected layer. kernel: (inputs, outputs)."""

    kernel: NDArray[np.float32]
    bias: NDArray[np.float32]

    def __call__(self, inputs: Singles, slope: float = _LINEAR) -> Singles:
        return dense(inputs, self.kernel, self.bias, slope)


class LicsPolicy:
    """Published network in compiled code, 4 M multiplications.

    weights: the arrays of `lme.planners.lics.weights.SHAPES`.
    """

    def __init__(self, weights: Arrays) -> None:
        self._positions = np.ascontiguousarray(weights["encoder.embedding.pos_embed"])
        self._patches = _dense(weights, "encoder.embedding.linear")
        self._goal = _dense(weights, "decoder.linear")
        self._head = _dense(weights, "prediction_head")
        self._encoder, self._decoder = (
            [_Layer(weights, f"{stack}.{k}", attended) for k in range(LAYERS)]
            for stack, attended in (ENCODER, DECODER)
        )

    def velocity(self, ranges: Singles, direction: Floats) -> Floats:
        """Return the velocity (2,) that the network wants, in shares of the greatest v and ω.

        ranges (720,) [m], from the right to the left; direction (2,): of the goal, in the robot frame, of length 1.
        """
        seen = self._patches(ranges.astype(np.float32).reshape(PATCHES, -1)) + self._positions
        for layer in self._encoder:
            seen = layer(seen, seen)
        wanted = self._goal(direction.astype(np.float32).reshape(GOAL, 1))
        for layer in self._decoder:
            wanted = layer(wanted, seen)
        answer: Floats = self._head(wanted.reshape(1, -1))[0].astype(np.float64)
        return answer


class _Layer:
    """Attention to tokens, then two dense layers for each token, with shortcuts and norms."""

    def __init__(self, weights: Arrays, name: str, attended: str) -> None:
        self._keys, self._values, self._queries, self._out = (
            _dense(weights, f"{name}.{attended}.{part}_proj") for part in ("k", "v", "q", "out")
        )
        forward = f"{name}.PositionWiseFeedForward"
        self._wide, self._narrow = (_dense(weights, f"{forward}.w_{k}") for k in (1, 2))
        self._norm, self._final_norm = (
            (weights[f"{name}.{norm}.weight"], weights[f"{name}.{norm}.bias"])
            for norm in (f"{attended}_layer_norm", "final_layer_norm")
        )

    def __call__(self, tokens: Singles, attended: Singles) -> Singles:
        found = attention(self._queries(tokens), self._keys(attended), self._values(attended), HEADS)
        tokens = added_and_normed(tokens, self._out(found), *self._norm)
        return added_and_normed(tokens, self._narrow(self._wide(tokens, _RELU)), *self._final_norm)


def _dense(weights: Arrays, name: str) -> _Dense:
    kernel = np.ascontiguousarray(weights[f"{name}.weight"].T)
    return _Dense(kernel, weights.get(f"{name}.bias", _NO_BIAS))
