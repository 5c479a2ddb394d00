"""Maximum of a linear layer's outputs over the rows of each scene, in torch.

Nearly all rows have no gradient. On a CPU torch spends most of an update on them; a kernel skips them.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from runners.learning.kernels import largest_gradients, largest_rows


def largest_output(inputs: Tensor, weight: Tensor) -> Tensor:
    """Return the maximum of `inputs @ weight.T` over the rows: (B, O). inputs: (B, K, I), weight: (O, I)."""
    if inputs.device.type != "cpu":
        return (inputs @ weight.T).amax(1)
    apply: Any = _Largest.apply
    found: Tensor = apply(inputs, weight)
    return found


class _Largest(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, inputs: Tensor, weight: Tensor) -> Tensor:
        best, where = largest_rows((inputs @ weight.T).detach().numpy())
        ctx.save_for_backward(inputs, weight)
        ctx.where = where
        return torch.from_numpy(best)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor]:
        inputs, weight = (each.detach().numpy() for each in ctx.saved_tensors)
        found = largest_gradients(gradient.contiguous().numpy(), inputs, weight, ctx.where)
        return torch.from_numpy(found[0]), torch.from_numpy(found[1])
