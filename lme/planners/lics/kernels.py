"""Attention and normalised sums, which a transformer needs besides dense layers. Arrays are float32."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Singles = NDArray[np.float32]

_LEAST_VARIANCE = np.float32(1e-5)  # PyTorch's default of a layer norm


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def attention(queries: Singles, keys: Singles, values: Singles, heads: int) -> Singles:
    """Mean of the values (M, W), weighted by the softmax of query · key / √W: (N, W).

    queries (N, W), keys (M, W). Each head has its own part of the W columns. As in the authors' code, the root is
    that of W, not of a head's width.
    """
    count, width = queries.shape
    part, scale = width // heads, np.float32(1.0 / math.sqrt(width))
    out, weights = np.zeros((count, width), np.float32), np.empty(len(keys), np.float32)
    for n in range(count):
        for first in range(0, width, part):
            # Score of every key for this head: q · k / √W.
            for m in range(len(keys)):
                product = np.float32(0.0)
                for c in range(first, first + part):
                    product += queries[n, c] * keys[m, c]
                weights[m] = product * scale
            # Softmax; subtracting the greatest score keeps exp from overflowing.
            weights[:] = np.exp(weights - weights.max())
            weights /= weights.sum()
            for m in range(len(keys)):
                for c in range(first, first + part):
                    out[n, c] += weights[m] * values[m, c]
    return out


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def added_and_normed(one: Singles, other: Singles, gain: Singles, shift: Singles) -> Singles:
    """The sum of two arrays (N, W), each row with mean 0 and variance 1, times the gain (W,) plus the shift (W,)."""
    out = one + other
    for n in range(len(out)):
        centred = out[n] - out[n].mean()
        out[n] = centred / np.sqrt((centred * centred).mean() + _LEAST_VARIANCE) * gain + shift
    return out
