"""DRL-DCLP's network in torch: the same layers and the same numbers as `lme.planners.dclp.network`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from lme.planners.dclp.network import DISTANCE, LEAST_DISTANCE, SLOPE
from lme.planners.dclp.weights import COMPONENTS, LAYERS, MIXTURE, SHAPES

_LOG_SIGMA = (-20.0, 2.0)  # bounds of the logarithm of a deviation, those in common use for SAC


class Output(NamedTuple):
    """What the network answers to B inputs. logits: (B, 4) of the components; mu, log_sigma: (B, 4, 2) before tanh."""

    logits: Tensor
    mu: Tensor
    log_sigma: Tensor


class DclpNetwork(nn.Module):
    """The published network. `weights` and `load` exchange the arrays of `SHAPES`."""

    def __init__(self) -> None:
        super().__init__()
        self.alpha: Tensor = nn.Parameter(torch.zeros(()))
        self.layers = nn.ModuleDict({name: _linear(SHAPES[f"{name}.kernel"]) for name in LAYERS})

    def forward(self, directions: Tensor, state: Tensor) -> Output:
        """directions: (B, 90, 6), state: (B, 8), as `lme.planners.dclp.interface.Features`."""
        distance = directions[..., DISTANCE, None]
        inverse = 1.0 / (distance + self.alpha).clamp(min=LEAST_DISTANCE)
        features = torch.cat((directions[..., :DISTANCE], inverse, directions[..., DISTANCE + 1 :]), -1)
        for name in LAYERS[:3]:
            features = _leaky(self._layer(name)(features))
        joint = torch.cat((features.amax(1), state), -1)
        for name in LAYERS[3:-1]:
            joint = _leaky(self._layer(name)(joint))
        output = self._layer(LAYERS[-1])(joint).view(-1, COMPONENTS, MIXTURE)
        return Output(output[..., 0], output[..., 1:3], output[..., 3:].clamp(*_LOG_SIGMA))

    def weights(self) -> dict[str, NDArray[np.float32]]:
        """The arrays of `SHAPES`."""
        found = {"alpha": self.alpha.detach().numpy().copy()}
        for name in LAYERS:
            layer = self._layer(name)
            found[f"{name}.kernel"] = np.ascontiguousarray(layer.weight.detach().numpy().T)
            found[f"{name}.bias"] = layer.bias.detach().numpy().copy()
        return found

    def load(self, weights: Mapping[str, NDArray[np.float32]]) -> None:
        """Take over the arrays of `SHAPES`."""
        with torch.no_grad():
            self.alpha.copy_(torch.from_numpy(np.asarray(weights["alpha"])))
            for name in LAYERS:
                layer = self._layer(name)
                layer.weight.copy_(torch.from_numpy(weights[f"{name}.kernel"].T.copy()))
                layer.bias.copy_(torch.from_numpy(weights[f"{name}.bias"]))

    def _layer(self, name: str) -> nn.Linear:
        return cast(nn.Linear, self.layers[name])


def _linear(shape: tuple[int, ...]) -> nn.Linear:
    inputs, outputs = shape
    return nn.Linear(inputs, outputs)


def _leaky(values: Tensor) -> Tensor:
    return nn.functional.leaky_relu(values, SLOPE)
