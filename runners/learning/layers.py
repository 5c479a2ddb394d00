"""Dense layers by name, as weight files hold them, and the range of robots that a network is trained for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from lme.types import Floats


def layer_arrays(layers: nn.ModuleDict) -> dict[str, NDArray[np.float32]]:
    """Return copies of `NAME.kernel` (inputs, outputs) and `NAME.bias` (outputs,) of all dense layers."""
    arrays = {}
    for name, module in layers.items():
        layer = cast(nn.Linear, module)
        arrays[f"{name}.kernel"] = np.ascontiguousarray(layer.weight.detach().cpu().numpy().T)
        arrays[f"{name}.bias"] = layer.bias.detach().cpu().numpy().copy()
    return arrays


def load_layers(layers: nn.ModuleDict, arrays: Mapping[str, NDArray[np.float32]]) -> None:
    """Set the layers to the arrays of `layer_arrays`."""
    with torch.no_grad():
        for name, module in layers.items():
            layer = cast(nn.Linear, module)
            layer.weight.copy_(torch.from_numpy(arrays[f"{name}.kernel"].T.copy()))
            layer.bias.copy_(torch.from_numpy(arrays[f"{name}.bias"]))


def trained_range(reported: Sequence[Floats]) -> NDArray[np.float32]:
    """Return the lowest and highest (N, 2) of the values (N,) that robots report to a network."""
    return np.column_stack([np.min(reported, axis=0), np.max(reported, axis=0)]).astype(np.float32)
