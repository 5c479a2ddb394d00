"""Fuzzy inference with one input and one output."""

from __future__ import annotations

import numpy as np

from lme.types import Floats

_INPUTS = 257  # samples of the curve, interpolated linearly
_OUTPUTS = 513  # samples of the output sets


class FuzzyCurve:
    """Mamdani inference for rules "if the input is about a_k, then the output is about b_k".

    Each set is a triangle between its neighbours' peaks. Output sets are clipped at the membership of the input
    (min) and joined (max); the output is the centroid of the result. Inputs beyond the outermost peaks belong to
    the outermost sets. The outermost sets are half triangles, so the outermost outputs are not quite reached.
    Source: Mamdani & Assilian 1975, DOI 10.1016/S0020-7373(75)80002-2.
    """

    def __init__(self, inputs: Floats, outputs: Floats) -> None:
        """Peaks (K,) of the input sets, rising, and of the output sets, rising or falling."""
        if outputs[0] > outputs[-1]:  # sort the output peaks, and keep the pairs
            rows = np.eye(len(outputs))[::-1]
            peaks = outputs[::-1]
        else:
            rows, peaks = np.eye(len(outputs)), outputs
        self._at = np.linspace(inputs[0], inputs[-1], _INPUTS)
        universe = np.linspace(peaks[0], peaks[-1], _OUTPUTS)
        covered = np.zeros((_INPUTS, _OUTPUTS))
        for membership, degrees in zip(np.eye(len(inputs)), rows, strict=True):
            degree = np.interp(self._at, inputs, membership)
            shape = np.interp(universe, peaks, degrees)
            np.maximum(covered, np.minimum(degree[:, None], shape), out=covered)
        weights = covered * _trapezoid_weights(_OUTPUTS)
        self._values = (weights @ universe) / weights.sum(axis=1)

    def __call__(self, value: float) -> float:
        """Return the output for one input."""
        return float(np.interp(value, self._at, self._values))


def _trapezoid_weights(count: int) -> Floats:
    """Weights of the trapezoidal rule for `count` evenly spaced samples."""
    weights = np.ones(count)
    weights[[0, -1]] = 0.5
    return weights
