"""DRL-VO network in torch: the same layers and the same numbers as `lme.planners.drl_vo.weights` writes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from lme.inputs.onnx_file import TRAINED
from lme.planners.drl_vo import weights as net
from lme.planners.drl_vo.observation import image_of
from lme.planners.drl_vo.planner import DrlVoConfig, DrlVoInterface
from lme.planners.drl_vo.weights import REPORTED, Convolution, Residual, Sizes, read_weights, write_weights
from lme.robots import Robot
from runners.learning.distributions import MixtureBatch

Arrays = Mapping[str, NDArray[np.float32]]

SMALL = Sizes(channels=8, features=64, hidden=64)  # ASSUMED: two cores can train it in an hour
_SIGMA = 0.3  # initial standard deviation of the actions
_MEAN_MAX = 0.999  # largest mean of an output, since atanh(1) is infinite


class Normed(nn.Module):
    """Convolution with its batch normalisation."""

    def __init__(self, layer: Convolution, channels: int) -> None:
        super().__init__()
        outputs = layer.outputs * channels
        inputs = layer.inputs * channels or net.IMAGE
        padding = layer.kernel // 2
        self.layer = layer
        self.convolution = nn.Conv2d(inputs, outputs, layer.kernel, layer.stride, padding, bias=layer.bias)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, x: Tensor) -> Tensor:
        """Return the normalised convolution of x: (B, inputs, height, width)."""
        return cast(Tensor, self.norm(self.convolution(x)))


class ResidualBlock(nn.Module):
    """Residual block: three convolutions, and a shortcut parallel to them."""

    def __init__(self, residual: Residual, channels: int) -> None:
        super().__init__()
        self.inside = nn.ModuleList(Normed(layer, channels) for layer in residual.inside)
        self.around = nn.Identity() if residual.shortcut is None else Normed(residual.shortcut, channels)

    def forward(self, x: Tensor, start: Tensor | None = None) -> Tensor:
        """Return the block's output. start: input of the shortcut, if it is not x."""
        first, second, third = self.inside
        inside = third(second(first(x).relu()).relu())
        return cast(Tensor, (inside + self.around(x if start is None else start)).relu())


class DrlVoBody(nn.Module):
    """Layers of the published network in any size, optionally with inputs besides the goal or other outputs."""

    def __init__(self, sizes: Sizes, more_inputs: int, outputs: int) -> None:
        super().__init__()
        self._build(sizes, more_inputs, outputs)

    def _build(self, sizes: Sizes, more_inputs: int, outputs: int) -> None:
        channels, features, hidden = sizes
        self.stem = Normed(net.STEM, channels)
        self.residuals = nn.ModuleList(ResidualBlock(residual, channels) for residual in net.RESIDUALS)
        self.features = nn.Linear(8 * channels + net.GOAL + more_inputs, features)
        self.hidden = nn.Linear(features, hidden)
        self.output = nn.Linear(hidden, outputs)
        with torch.no_grad():
            self.output.weight *= 0.1
        self.eval()

    def answer(self, sweeps: Tensor, pedestrians: Tensor, joint: Tensor) -> Tensor:
        """Return the outputs (B, outputs) of B scenes, or (B, K, outputs).

        sweeps: (B, 20, 80), pedestrians: (B, P, 4), joint: (B, J), or (B, K, J) with K of them per scene.
        """
        pairs = zip(sweeps.cpu().numpy(), pedestrians.cpu().numpy(), strict=True)
        image = torch.from_numpy(np.stack([image_of(*pair) for pair in pairs])).to(sweeps.device)
        seen = self._image_features(image)
        if joint.dim() == 3:
            seen = seen[:, None].expand(-1, joint.shape[1], -1)
        features = self.features(torch.cat((seen, joint), -1)).relu()
        return cast(Tensor, self.output(self.hidden(features).tanh()))

    def _image_features(self, image: Tensor) -> Tensor:
        """Return image features (B, 8 c) of images (B, 3, 80, 80)."""
        layer_1_0, layer_1_1, layer_2, refinement_2, layer_3, refinement_3 = self.residuals
        stem = nn.functional.max_pool2d(self.stem(image).relu(), 3, 1, 1)
        first = layer_1_1(layer_1_0(stem))
        second = refinement_2(layer_2(first), first)
        third: Tensor = refinement_3(layer_3(second), stem)
        return third.mean((2, 3))


class DrlVoCritic(DrlVoBody):
    """Critic: value of a scene, or of an action in it, from layers like the policy's."""

    def __init__(self, actions: int) -> None:
        super().__init__(SMALL, actions, 1)

    def forward(self, sweeps: Tensor, pedestrians: Tensor, goal: Tensor, *actions: Tensor) -> Tensor:
        """Return values (B,) from the policy's features, and from actions (B, A) if the critic takes them.

        K actions per scene (B, K, A) give (B, K).
        """
        for several in actions:
            if several.dim() == 3:
                goal = goal[:, None].expand(-1, several.shape[1], -1)
        return self.answer(sweeps, pedestrians, torch.cat((goal, *actions), -1))[..., 0]


class DrlVoNetwork(DrlVoBody):
    """Published network in the size `SMALL`, or in that of the weights that it loads.

    Its output is a Gaussian about the clipped mean. The standard deviation applies before tanh.
    """

    def __init__(self) -> None:
        super().__init__(SMALL, 0, net.ACTIONS)
        self.log_std = nn.Parameter(torch.full((net.ACTIONS,), math.log(_SIGMA)))
        self._trained = np.zeros(len(REPORTED), np.float32)

    def forward(self, sweeps: Tensor, pedestrians: Tensor, goal: Tensor) -> MixtureBatch:
        """Return the distributions of actions.

        sweeps: (B, 20, 80), pedestrians: (B, 32, 4), goal: (B, 2), as `DrlVoFeatures`.
        """
        mean = self.answer(sweeps, pedestrians, goal)
        # Straight-through clip: the value of the mean is clipped, its gradient is not.
        mean = mean + (mean.clamp(-_MEAN_MAX, _MEAN_MAX) - mean).detach()
        mu = mean.atanh()[:, None]
        return MixtureBatch(mu.new_zeros(len(mu), 1), mu, self.log_std.expand_as(mu))

    @staticmethod
    def interface(planner: DrlVoConfig, robot: Robot) -> DrlVoInterface:
        """Return the network's inputs, and the meaning of its output."""
        return DrlVoInterface(planner, robot)

    def trained_for(self, planner: DrlVoConfig, robots: Iterable[Robot]) -> None:
        """Store the largest commands. The network's inputs do not depend on the robots."""
        self._trained = np.array([getattr(planner, key) for key in REPORTED], np.float32)

    @staticmethod
    def critic(actions: int) -> DrlVoCritic:
        """Return a critic with the same inputs and `actions` further numbers."""
        return DrlVoCritic(actions)

    def weights(self, sharpness: float = 1.0) -> dict[str, NDArray[np.float32]]:
        """Return the arrays of a file. sharpness: ignored, because there is only one component."""
        arrays = {name: tensor.detach().cpu().numpy().copy(order="C") for name, tensor in self._tensors()}
        return {**arrays, TRAINED: self._trained.copy()}

    def load(self, weights: Arrays) -> None:
        """Set the arrays that `lme.planners.drl_vo.weights` lists, and their sizes."""
        sizes = net.checked_sizes({name: array.shape for name, array in weights.items()}, "weights")
        self._build(sizes, 0, net.ACTIONS)
        with torch.no_grad():
            for name, tensor in self._tensors():
                tensor.copy_(torch.from_numpy(weights[name]))

    def mirror(self, features: tuple[Tensor, ...], actions: Tensor) -> tuple[tuple[Tensor, ...], Tensor]:
        """Return features and actions with left and right swapped."""
        sweeps, pedestrians, goal = features
        across = actions.new_tensor([1.0, -1.0])
        return (sweeps.flip(-1), pedestrians * across.repeat(2), goal * across), actions * across

    @staticmethod
    def read(path: Path) -> Arrays:
        """Read the arrays in a file. Raises InputError."""
        return read_weights(path)

    @staticmethod
    def write(weights: Arrays, file: IO[bytes]) -> None:
        """Write a file for `planner.weights`."""
        write_weights(weights, file)

    def _tensors(self) -> Iterator[tuple[str, Tensor]]:
        """Yield the tensors that a file holds, by name."""
        for normed in (module for module in self.modules() if isinstance(module, Normed)):
            layer = normed.layer
            yield f"{net.EXTRACTOR}{layer.name}.weight", normed.convolution.weight
            if normed.convolution.bias is not None:
                yield f"{net.EXTRACTOR}{layer.name}.bias", normed.convolution.bias
            for part in net.NORM:
                yield f"{net.EXTRACTOR}{layer.norm}.{part}", getattr(normed.norm, part)
        for name, linear in (
            (net.FEATURES, self.features),
            (net.HIDDEN, self.hidden),
            (net.ACTION, self.output),
        ):
            yield f"{name}.weight", linear.weight
            yield f"{name}.bias", linear.bias
        yield net.LOG_STD, self.log_std
