"""Maximum of a linear layer's outputs over the rows of each scene, and its gradient.

Nearly all rows have no gradient. On a CPU torch spends most of an update on them; a kernel skips them.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor

Array = NDArray[np.float32]
Rows = NDArray[np.int64]


def largest_output(inputs: Tensor, weight: Tensor) -> Tensor:
    """Return the maximum of `inputs @ weight.T` over the rows: (B, O). inputs: (B, K, I), weight: (O, I)."""
    if inputs.device.type != "cpu":
        return (inputs @ weight.T).amax(1)
    apply: Any = _Largest.apply
    return cast(Tensor, apply(inputs, weight))


class _Largest(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, inputs: Tensor, weight: Tensor) -> Tensor:
        best, where = largest_rows((inputs @ weight.T).detach().numpy())
        ctx.save_for_backward(inputs, weight)
        ctx.where = where
        return torch.from_numpy(best)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor]:
        inputs, weight = (tensor.detach().numpy() for tensor in ctx.saved_tensors)
        of_inputs, of_weight = largest_gradients(gradient.contiguous().numpy(), inputs, weight, ctx.where)
        return torch.from_numpy(of_inputs), torch.from_numpy(of_weight)


@njit(cache=True, error_model="numpy")
def largest_rows(outputs: Array) -> tuple[Array, Rows]:
    """Return the largest output over the K rows of each scene, and its first row: both (B, O) of (B, K, O)."""
    scenes, rows, width = outputs.shape
    best, where = np.empty((scenes, width), np.float32), np.zeros((scenes, width), np.int64)
    # best = max_k outputs[b, k, o], where = the first such k.
    for b in range(scenes):
        for o in range(width):
            best[b, o] = outputs[b, 0, o]
        for k in range(1, rows):
            for o in range(width):  # without branches, so that it vectorises
                value, larger = outputs[b, k, o], outputs[b, k, o] > best[b, o]
                best[b, o] = value if larger else best[b, o]
                where[b, o] = k if larger else where[b, o]
    return best, where


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def largest_gradients(gradient: Array, inputs: Array, weight: Array, where: Rows) -> tuple[Array, Array]:
    """Return the gradients of the inputs (B, K, I) and of the weight (O, I); only the largest rows contribute.

    gradient (B, O): that of the largest outputs; where (B, O): their rows.
    """
    # y_bo = w_o · x_b,k(b,o) gives dL/dx_bk = Σ_o g_bo w_o over the o with k(b,o) = k, dL/dw_o = Σ_b g_bo x_b,k(b,o).
    of_inputs, of_weight = np.zeros_like(inputs), np.zeros_like(weight)
    for b in range(len(gradient)):
        for o in range(len(weight)):
            k, slope = where[b, o], gradient[b, o]
            for i in range(weight.shape[1]):
                of_inputs[b, k, i] += slope * weight[o, i]
                of_weight[o, i] += slope * inputs[b, k, i]
    return of_inputs, of_weight
