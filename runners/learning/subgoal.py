"""Subgoal network in torch: the same layers and the same numbers as `lme.guides.learned_subgoal.network` writes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from lme.guides.learned_subgoal.guide import LearnedSubgoalConfig, SubgoalInterface, reported_values
from lme.guides.learned_subgoal.network import (
    BEARINGS,
    LAYERS,
    RANGES,
    REPORTED,
    SHAPES,
    SIGNATURE,
    SLOPE,
    mirrored_bearings,
    write_weights,
)
from lme.inputs.onnx_file import TRAINED
from lme.inputs.onnx_graph import read_weights
from lme.robots import Robot
from runners.learning.distributions import ChoiceBatch
from runners.learning.layers import layer_arrays, load_layers, trained_range

# Signs of the sine of the target, ω, and y of the last subgoal change.
_MIRRORED_STATE = (1, 1, -1, 1, -1, 1, 1, 1, 1, 1, -1)


class SubgoalBody(nn.Module):
    """Layers of the network, optionally with further inputs or with other outputs."""

    def __init__(self, more_inputs: int, outputs: int) -> None:
        super().__init__()
        shapes = [SHAPES[f"{name}.kernel"] for name in LAYERS]
        shapes[0] = (shapes[0][0] + more_inputs, shapes[0][1])
        shapes[-1] = (shapes[-1][0], outputs)
        layers = (nn.Linear(rows, columns) for rows, columns in shapes)
        self.layers = nn.ModuleDict(dict(zip(LAYERS, layers, strict=True)))
        for name in LAYERS:
            nn.init.orthogonal_(self.layer(name).weight, 0.01 if name == LAYERS[-1] else 2.0**0.5)
            nn.init.zeros_(self.layer(name).bias)

    def layer(self, name: str) -> nn.Linear:
        """Return one of `LAYERS`."""
        return cast(nn.Linear, self.layers[name])

    def output(self, scan: Tensor, free: Tensor, *more: Tensor) -> Tensor:
        """Return the outputs. scan: (B, BEARINGS), free: (B, CANDIDATES), more: (B, …), such as the state."""
        ways = free.view(-1, BEARINGS, len(RANGES)).mean(-1)
        values = torch.cat((scan, ways, *more), -1)
        for name in LAYERS[:-1]:
            values = nn.functional.leaky_relu(self.layer(name)(values), SLOPE)
        return cast(Tensor, self.layer(LAYERS[-1])(values))


class SubgoalCritic(SubgoalBody):
    """Critic: value of a scene, from layers like the policy's."""

    def __init__(self, actions: int) -> None:
        super().__init__(actions, 1)

    def forward(self, scan: Tensor, free: Tensor, state: Tensor, *actions: Tensor) -> Tensor:
        """Return values (B,) from the policy's features, and from actions (B, A) if the critic takes them."""
        return self.output(scan, free, state, *actions)[:, 0]


class SubgoalNetwork(SubgoalBody):
    """Network that chooses subgoals. `weights` and `load` exchange the arrays of `SHAPES`."""

    def __init__(self) -> None:
        super().__init__(0, SHAPES[f"{LAYERS[-1]}.bias"][0])
        self._trained = np.zeros((len(REPORTED), 2), np.float32)

    def forward(self, scan: Tensor, free: Tensor, state: Tensor) -> ChoiceBatch:
        """Return the distributions of choices.

        scan: (B, BEARINGS), free: (B, CANDIDATES), state: (B, STATE_INPUTS), as `SubgoalFeatures`.
        """
        return ChoiceBatch(self.output(scan, free, state).masked_fill(free == 0.0, -torch.inf))

    @staticmethod
    def interface(config: LearnedSubgoalConfig, robot: Robot) -> SubgoalInterface:
        """Return the network's inputs for a robot, and the meaning of its choice."""
        return SubgoalInterface(config, robot)

    def trained_for(self, config: LearnedSubgoalConfig, robots: Iterable[Robot]) -> None:
        """Store the range of robots that the network is trained for, from the robots of lowest and highest values."""
        reported = [reported_values(robot) for robot in robots]
        self._trained = trained_range(reported)

    @staticmethod
    def critic(actions: int) -> SubgoalCritic:
        """Return a critic with the same inputs and `actions` further numbers."""
        return SubgoalCritic(actions)

    def weights(self, sharpness: float = 1.0) -> dict[str, NDArray[np.float32]]:
        """Return the arrays of a file. sharpness: factor on the logits of the candidates."""
        arrays = {TRAINED: self._trained.copy(), **layer_arrays(self.layers)}
        for part in ("kernel", "bias"):
            arrays[f"{LAYERS[-1]}.{part}"] *= sharpness
        return arrays

    def load(self, weights: Mapping[str, NDArray[np.float32]]) -> None:
        """Set the arrays of `SHAPES`."""
        load_layers(self.layers, weights)

    def mirror(self, features: tuple[Tensor, ...], actions: Tensor) -> tuple[tuple[Tensor, ...], Tensor]:
        """Return features and candidates (B,) with left and right swapped."""
        # Candidate number = bearing · len(RANGES) + range: mirror the bearing, keep the range.
        scan, free, state = features
        across = torch.from_numpy(mirrored_bearings()).to(scan.device)
        turned = free.view(-1, BEARINGS, len(RANGES))[:, across].flatten(1)
        chosen = across[actions // len(RANGES)] * len(RANGES) + actions % len(RANGES)
        return (scan[:, across], turned, state * state.new_tensor(_MIRRORED_STATE)), chosen

    @staticmethod
    def read(path: Path) -> Mapping[str, NDArray[np.float32]]:
        """Read the arrays of `SHAPES` in a file. Raises InputError."""
        return read_weights(path, SIGNATURE.what, SHAPES)

    @staticmethod
    def write(weights: Mapping[str, NDArray[np.float32]], file: IO[bytes]) -> None:
        """Write a file for `guide.weights`."""
        write_weights(weights, file)
