"""The largest of a linear layer's outputs over the rows of each scene, and its gradient."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float32]
Rows = NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def largest_rows(outputs: Array) -> tuple[Array, Rows]:
    """The largest output over the K rows of each scene, and its first row. outputs (B, K, O): both (B, O)."""
    scenes, rows, width = outputs.shape
    best, where = np.empty((scenes, width), np.float32), np.zeros((scenes, width), np.int64)
    for b in range(scenes):
        for o in range(width):
            best[b, o] = outputs[b, 0, o]
        for k in range(1, rows):
            for o in range(width):  # no branch, for vectorisation
                value, larger = outputs[b, k, o], outputs[b, k, o] > best[b, o]
                best[b, o] = value if larger else best[b, o]
                where[b, o] = k if larger else where[b, o]
    return best, where


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def largest_gradients(gradient: Array, inputs: Array, weight: Array, where: Rows) -> tuple[Array, Array]:
    """Gradients of the inputs (B, K, I) and of the weight (O, I), of which only the largest rows have any.

    gradient (B, O): of the largest outputs; where (B, O): their rows.
    """
    of_inputs, of_weight = np.zeros_like(inputs), np.zeros_like(weight)
    for b in range(len(gradient)):
        for o in range(len(weight)):
            k, slope = where[b, o], gradient[b, o]
            for i in range(weight.shape[1]):
                of_inputs[b, k, i] += slope * weight[o, i]
                of_weight[o, i] += slope * inputs[b, k, i]
    return of_inputs, of_weight
