"""DRL-DCLP's network in torch: the same layers and the same numbers as `lme.planners.dclp.weights` writes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from lme.inputs.onnx_file import TRAINED
from lme.inputs.onnx_graph import read_weights
from lme.planners.dclp.planner import DclpConfig, DclpInterface, reported_values
from lme.planners.dclp.weights import (
    COMPONENTS,
    CONVOLUTIONS,
    DISTANCE,
    LAYERS,
    LEAST_DISTANCE,
    MIXTURE,
    REPORTED,
    SHAPES,
    SIGNATURE,
    SLOPE,
    STATE_INPUTS,
    write_weights,
)
from lme.robots import Robot
from runners.learning.distributions import MixtureBatch
from runners.learning.largest import largest_output
from runners.learning.layers import layer_arrays, load_layers, trained_range

_FIRST_JOINT, _LAST = "dense_1", LAYERS[-1]
_LOG_SIGMA = (-20.0, 2.0)  # bounds of the logarithm of a deviation, as commonly used for SAC
# Initial weights: state inputs weigh about as much as the others; components drive ahead, left, right, and stop.
_ALPHA = 0.3  # [m]
_STATE_SCALE = (0.3, 0.7, 0.7, 0.4, 0.5, 0.25, 0.05, 0.04)
_FIRST_ACTIONS = (
    (1.0, 0.0, -1.0, -1.0),
    (0.3, 0.5, -1.0, -1.0),
    (0.3, -0.5, -1.0, -1.0),
    (0.0, 0.0, -1.0, -1.0),
)


class DclpBody(nn.Module):
    """Layers of the published network, optionally with inputs besides the state, or with other outputs."""

    def __init__(self, more_inputs: int, outputs: int) -> None:
        super().__init__()
        self.alpha: Tensor = nn.Parameter(torch.tensor(_ALPHA))
        shapes = {name: SHAPES[f"{name}.kernel"] for name in LAYERS}
        shapes[_FIRST_JOINT] = (shapes[_FIRST_JOINT][0] + more_inputs, shapes[_FIRST_JOINT][1])
        shapes[_LAST] = (shapes[_LAST][0], outputs)
        self.layers = nn.ModuleDict({name: _linear(shape) for name, shape in shapes.items()})
        with torch.no_grad():
            begin = CONVOLUTIONS[-1]
            self.layer(_FIRST_JOINT).weight[:, begin : begin + STATE_INPUTS] *= torch.tensor(_STATE_SCALE)
            self.layer(_LAST).weight *= 0.1

    def layer(self, name: str) -> nn.Linear:
        """Return one of `LAYERS`."""
        return cast(nn.Linear, self.layers[name])

    def output(self, directions: Tensor, joint: Tensor) -> Tensor:
        """Return the outputs (B, outputs) of B scenes, or (B, K, outputs).

        directions: (B, 90, 6). joint: (B, J) state and further inputs, or (B, K, J) with K of them per scene.
        """
        nearest = self._nearest(directions)
        if joint.dim() == 3:
            nearest = nearest[:, None].expand(-1, joint.shape[1], -1)
        joint = torch.cat((nearest, joint), -1)
        for name in LAYERS[3:-1]:
            joint = _leaky(self.layer(name)(joint))
        output: Tensor = self.layer(_LAST)(joint)
        return output

    def _nearest(self, directions: Tensor) -> Tensor:
        """Return the maximum of each feature over the directions: (B, 128)."""
        # The distance d enters as 1 / (d + α), with α learned; then three layers and the maximum over directions.
        distance = directions[..., DISTANCE, None]
        inverse = 1.0 / (distance + self.alpha).clamp(min=LEAST_DISTANCE)
        features = torch.cat((directions[..., :DISTANCE], inverse, directions[..., DISTANCE + 1 :]), -1)
        for name in LAYERS[:2]:
            features = _leaky(self.layer(name)(features))
        last = self.layer(LAYERS[2])
        return _leaky(largest_output(features, last.weight) + last.bias)


class DclpCritic(DclpBody):
    """Critic: value of a scene, or of an action in it, from layers like the policy's."""

    def __init__(self, actions: int) -> None:
        super().__init__(actions, 1)

    def forward(self, directions: Tensor, state: Tensor, *actions: Tensor) -> Tensor:
        """Return values (B,) from the policy's features, and from actions (B, A) if the critic takes them.

        K actions per scene (B, K, A) give (B, K).
        """
        for several in actions:
            if several.dim() == 3:
                state = state[:, None].expand(-1, several.shape[1], -1)
        return self.output(directions, torch.cat((state, *actions), -1))[..., 0]


class DclpNetwork(DclpBody):
    """Published network. `weights` and `load` exchange the arrays of `SHAPES`."""

    def __init__(self) -> None:
        super().__init__(0, COMPONENTS * MIXTURE)
        self._trained = np.zeros((len(REPORTED), 2), np.float32)
        with torch.no_grad():
            self.layer(_LAST).bias.view(COMPONENTS, MIXTURE)[:, 1:] = torch.tensor(_FIRST_ACTIONS)

    def forward(self, directions: Tensor, state: Tensor) -> MixtureBatch:
        """Return the distributions of actions. directions: (B, 90, 6), state: (B, 8), as `DclpFeatures`."""
        output = self.output(directions, state).view(-1, COMPONENTS, MIXTURE)
        return MixtureBatch(output[..., 0], output[..., 1:3], output[..., 3:].clamp(*_LOG_SIGMA))

    @staticmethod
    def interface(planner: DclpConfig, robot: Robot) -> DclpInterface:
        """Return the network's inputs for a robot, and the meaning of its output."""
        return DclpInterface(planner, robot)

    def trained_for(self, planner: DclpConfig, robots: Iterable[Robot]) -> None:
        """Store the range of robots that the network is trained for, from the robots of lowest and highest values."""
        reported = [reported_values(DclpInterface(planner, robot).reported_limits) for robot in robots]
        self._trained = trained_range(reported)

    @staticmethod
    def critic(actions: int) -> DclpCritic:
        """Return a critic with the same inputs and `actions` further numbers."""
        return DclpCritic(actions)

    def weights(self, sharpness: float = 1.0) -> dict[str, NDArray[np.float32]]:
        """Return the arrays of a file. sharpness: factor on the logits of the components."""
        arrays = {"alpha": self.alpha.detach().cpu().numpy().copy(), TRAINED: self._trained.copy()}
        arrays |= layer_arrays(self.layers)
        arrays[f"{_LAST}.kernel"][:, ::MIXTURE] *= sharpness
        arrays[f"{_LAST}.bias"][::MIXTURE] *= sharpness
        return arrays

    def load(self, weights: Mapping[str, NDArray[np.float32]]) -> None:
        """Set the arrays of `SHAPES`."""
        with torch.no_grad():
            self.alpha.copy_(torch.from_numpy(np.asarray(weights["alpha"])))
        load_layers(self.layers, weights)

    def mirror(self, features: tuple[Tensor, ...], actions: Tensor) -> tuple[tuple[Tensor, ...], Tensor]:
        """Return features and actions with left and right swapped."""
        directions, state = features
        across, turns = directions.new_ones(directions.shape[-1]), state.new_ones(state.shape[-1])
        across[0] = turns[1] = turns[3] = -1.0  # sign changes: cos to the right; bearing of the target; ω
        return (directions * across, state * turns), actions * actions.new_tensor([1.0, -1.0])

    @staticmethod
    def read(path: Path) -> Mapping[str, NDArray[np.float32]]:
        """Read the arrays of `SHAPES` in a file. Raises InputError."""
        return read_weights(path, SIGNATURE.what, SHAPES)

    @staticmethod
    def write(weights: Mapping[str, NDArray[np.float32]], file: IO[bytes]) -> None:
        """Write a file for `planner.weights`."""
        write_weights(weights, file)


def _linear(shape: tuple[int, ...]) -> nn.Linear:
    """Return a layer with the initial weights of He et al. (2015) for ReLUs."""
    inputs, outputs = shape
    layer = nn.Linear(inputs, outputs)
    nn.init.kaiming_normal_(layer.weight, a=SLOPE)
    nn.init.zeros_(layer.bias)
    return layer


def _leaky(values: Tensor) -> Tensor:
    return nn.functional.leaky_relu_(values, SLOPE)  # in place, since half of the time is memory access
