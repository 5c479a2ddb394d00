"""Fuzzy inference with one input and one output: a curve through rules in words."""

from __future__ import annotations

import numpy as np

from lme.types import Floats

_INPUTS = 257  # where the curve is tabulated; linear between
_OUTPUTS = 513  # where the output sets are sampled


class FuzzyCurve:
    """Rules "where the input is about a_k, the output is about b_k", answered by one number.

    Each set is a triangle that reaches to its neighbours' peaks. The output sets are cut off at how far the
    input belongs to its own (min) and joined (max); the answer is the centroid of what they cover. Inputs
    beyond the outermost peaks belong to the outermost sets. At the ends the sets are halves, so that the
    outermost outputs are not quite reached.
    Source: Mamdani & Assilian 1975, DOI 10.1016/S0020-7373(75)80002-2.
    """

    def __init__(self, inputs: Floats, outputs: Floats) -> None:
        """Peaks (K,) of the input sets, rising, and of the output sets, rising or falling."""
        if outputs[0] > outputs[-1]:  # sets are sampled from low to high; the pairs stay together
            rows = np.eye(len(outputs))[::-1]
            peaks = outputs[::-1]
        else:
            rows, peaks = np.eye(len(outputs)), outputs
        self._at = np.linspace(inputs[0], inputs[-1], _INPUTS)
        universe = np.linspace(peaks[0], peaks[-1], _OUTPUTS)
        covered = np.zeros((_INPUTS, _OUTPUTS))
        for row_in, row_out in zip(np.eye(len(inputs)), rows, strict=True):
            degree = np.interp(self._at, inputs, row_in)
            shape = np.interp(universe, peaks, row_out)
            np.maximum(covered, np.minimum(degree[:, None], shape), out=covered)
        weights = covered * _trapezoid_weights(_OUTPUTS)
        self._values = (weights @ universe) / weights.sum(axis=1)

    def __call__(self, value: float) -> float:
        """The output for one input."""
        return float(np.interp(value, self._at, self._values))


def _trapezoid_weights(count: int) -> Floats:
    """Of the samples of an integral over even steps: the two at the ends count half."""
    weights = np.ones(count)
    weights[[0, -1]] = 0.5
    return weights
