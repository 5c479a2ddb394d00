"""Layers of the DRL-VO network, the names and shapes of its weights, and its ONNX file.

It has three sizes: c channels (published: 64), f features (256) and h hidden units (256). The architecture
is the same for all sizes. Inputs: an image (3, 80, 80) of scans and of pedestrians' vx and vy, and a sub-goal (2,).

    convolution           norm          inputs → outputs     kernel  stride  bias
    conv1                 bn1                3 → c           3 × 3   1       no    ReLU, maximum of 3 × 3, stride 1
    layer1.0.conv1,2,3    .bn1,2,3           c → c → c → 2c  1, 3, 1 1       no    + downsample; ReLU
    layer1.0.downsample.0 .downsample.1      c → 2c          1 × 1   1       no    of the maximum
    layer1.1.conv1,2,3    .bn1,2,3          2c → c → c → 2c  1, 3, 1 1       no    + what goes in; ReLU
    layer2.0.conv1,2,3    .bn1,2,3          2c → 2c → 2c → 4c        2: conv2      + downsample; ReLU
    layer2.0.downsample.0 .downsample.1     2c → 4c          1 × 1   2       no    of layer1
    conv2_2.0,3,6         conv2_2.1,4,7     4c → 2c → 2c → 4c        1       yes   + downsample2; ReLU
    downsample2.0         downsample2.1     2c → 4c          1 × 1   2       yes   of layer1
    layer3.0.conv1,2,3    .bn1,2,3          4c → 4c → 4c → 8c        2: conv2      + downsample; ReLU
    layer3.0.downsample.0 .downsample.1     4c → 8c          1 × 1   2       no    of what goes into layer3
    conv3_2.0,3,6         conv3_2.1,4,7     8c → 4c → 4c → 8c        1       yes   + downsample3; ReLU; mean
    downsample3.0         downsample3.1      c → 8c          1 × 1   4       yes   of the maximum
    linear_fc.0                             8c + 2 → f                       yes   of mean and sub-goal; ReLU
    mlp_extractor.policy_net.0               f → h                           yes   tanh
    action_net                               h → 2                           yes   means of the action
    log_std                                      2                                 logs of its deviations

A ReLU follows the norms of the first two of every three convolutions. A convolution's or linear layer's
arrays are `NAME.weight`, (outputs, inputs, height, width) or (outputs, inputs), and `NAME.bias`, (outputs,). A norm's
are weight, bias, running_mean and running_var, each (outputs,). The names down to `linear_fc` begin with
`features_extractor.`, so all names are those of the policy in Stable-Baselines3.
Source: `custom_cnn_full.py` in github.com/TempleRAIL/drl_vo_nav.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.onnx_file import TRAINED, Arrays, Shape, Signature
from lme.inputs.onnx_graph import OnnxGraph
from lme.inputs.onnx_graph import read_weights as read_arrays

EXTRACTOR = "features_extractor."
FEATURES = f"{EXTRACTOR}linear_fc.0"
HIDDEN = "mlp_extractor.policy_net.0"
ACTION = "action_net"
LOG_STD = "log_std"
NORM = ("weight", "bias", "running_mean", "running_var")
IMAGE, SIDE, GOAL, ACTIONS = 3, 80, 2, 2
_LARGEST = 1024  # channels, features or hidden units; the published network has at most 256
REPORTED = ("v_max", "omega_max")  # of the planner: the greatest commands that it gives
SIGNATURE = Signature(
    "drl_vo",
    "a DRL-VO network",
    {"image": (IMAGE, SIDE, SIDE), "goal": (GOAL,)},  # `observation.image_of`; look-ahead distances
    {"means": (ACTIONS,), "deviations": (ACTIONS,)},
    (len(REPORTED),),  # the greatest values of REPORTED
)
_EPSILON = 1e-5  # of the norms, PyTorch's default


class Convolution(NamedTuple):
    """A convolution and its norm. inputs, outputs: multiples of c; inputs 0: the image."""

    name: str
    norm: str
    inputs: int
    outputs: int
    kernel: int = 1
    stride: int = 1
    bias: bool = False


class Residual(NamedTuple):
    """Three convolutions and their shortcut, also a convolution; None: the input itself."""

    inside: tuple[Convolution, Convolution, Convolution]
    shortcut: Convolution | None


class Sizes(NamedTuple):
    """Sizes that determine the shapes of all weights."""

    channels: int
    features: int
    hidden: int


def _block(name: str, inputs: int, width: int, stride: int = 1) -> Residual:
    inside = (
        Convolution(f"{name}.conv1", f"{name}.bn1", inputs, width),
        Convolution(f"{name}.conv2", f"{name}.bn2", width, width, 3, stride),
        Convolution(f"{name}.conv3", f"{name}.bn3", width, 2 * width),
    )
    shortcut = (
        None if inputs == 2 * width else _shortcut(f"{name}.downsample", inputs, 2 * width, stride, False)
    )
    return Residual(inside, shortcut)


def _refinement(name: str, channels: int, shortcut: Convolution) -> Residual:
    inner = channels // 2
    inside = (
        Convolution(f"{name}.0", f"{name}.1", channels, inner, bias=True),
        Convolution(f"{name}.3", f"{name}.4", inner, inner, 3, bias=True),
        Convolution(f"{name}.6", f"{name}.7", inner, channels, bias=True),
    )
    return Residual(inside, shortcut)


def _shortcut(name: str, inputs: int, outputs: int, stride: int, bias: bool) -> Convolution:
    return Convolution(f"{name}.0", f"{name}.1", inputs, outputs, 1, stride, bias)


STEM = Convolution("conv1", "bn1", 0, 1, 3)
LAYER_1_0, LAYER_1_1 = _block("layer1.0", 1, 1), _block("layer1.1", 2, 1)
LAYER_2, LAYER_3 = _block("layer2.0", 2, 2, 2), _block("layer3.0", 4, 4, 2)
REFINEMENT_2 = _refinement("conv2_2", 4, _shortcut("downsample2", 2, 4, 2, True))
REFINEMENT_3 = _refinement("conv3_2", 8, _shortcut("downsample3", 1, 8, 4, True))
RESIDUALS = (LAYER_1_0, LAYER_1_1, LAYER_2, REFINEMENT_2, LAYER_3, REFINEMENT_3)


def shapes(sizes: Sizes) -> dict[str, Shape]:
    """Return the shape of every array by its name."""
    c, f, h = sizes
    found = dict(_convolution_shapes(STEM, c))
    for inside, shortcut in RESIDUALS:
        for layer in (*inside, shortcut):
            found |= _convolution_shapes(layer, c) if layer else ()
    for name, outputs, inputs in ((FEATURES, f, 8 * c + GOAL), (HIDDEN, h, f), (ACTION, ACTIONS, h)):
        found |= {f"{name}.weight": (outputs, inputs), f"{name}.bias": (outputs,)}
    return {**found, LOG_STD: (ACTIONS,)}


def checked_sizes(found: Mapping[str, Shape], source: str) -> Sizes:
    """Return the sizes of the network whose arrays are among those found, possibly with others.

    source: the file, for messages. Raises InputError, naming the array, if one is missing or they disagree.
    """
    first = (f"{EXTRACTOR}{STEM.name}.weight", f"{FEATURES}.weight", f"{HIDDEN}.weight")
    sizes = Sizes(*(_outputs(found, name, source) for name in first))
    for name, shape in shapes(sizes).items():
        if _shape(found, name, source) != shape:
            raise InputError(
                f"{source}: {name} has the shape {found[name]}: must be {shape} in a DRL-VO network of "
                f"{sizes.channels} channels, {sizes.features} features and {sizes.hidden} hidden units"
            )
    return sizes


def _convolution_shapes(layer: Convolution, channels: int) -> Iterator[tuple[str, Shape]]:
    outputs, inputs = layer.outputs * channels, layer.inputs * channels or IMAGE
    yield f"{EXTRACTOR}{layer.name}.weight", (outputs, inputs, layer.kernel, layer.kernel)
    if layer.bias:
        yield f"{EXTRACTOR}{layer.name}.bias", (outputs,)
    for part in NORM:
        yield f"{EXTRACTOR}{layer.norm}.{part}", (outputs,)


def _outputs(found: Mapping[str, Shape], name: str, source: str) -> int:
    shape = _shape(found, name, source)
    if not shape or not 1 <= shape[0] <= _LARGEST:
        raise InputError(f"{source}: {name} has the shape {shape}: must have 1 to {_LARGEST} rows")
    return shape[0]


def _shape(found: Mapping[str, Shape], name: str, source: str) -> Shape:
    if name not in found:
        raise InputError(f"{source}: {name} is missing: must hold the weights of a DRL-VO network")
    return found[name]


def write_weights(weights: Arrays, file: IO[bytes], batch_norm: str = "running") -> None:
    """Write a network as an ONNX file. The same weights give the same bytes.

    weights: the arrays of `shapes`, and `TRAINED`. batch_norm: "sample" normalises by mean and variance
    of each feature map itself, "running" by those of the training. Raises InputError, naming the array, if one is
    missing or has another shape.
    """
    sizes = checked_sizes({name: array.shape for name, array in weights.items()}, "weights")
    graph = _Graph({name: weights[name] for name in shapes(sizes)}, batch_norm)
    graph.add_network()
    file.write(graph.model(SIGNATURE, weights[TRAINED]))


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read the arrays of `shapes` from a file that `write_weights` made, to train them on.

    Raises InputError, naming file and array, for a file that cannot be read, and for other arrays.
    """
    arrays = read_arrays(path, SIGNATURE.what)
    sizes = checked_sizes({name: array.shape for name, array in arrays.items()}, str(path))
    return {name: arrays[name] for name in shapes(sizes)}


class _Graph(OnnxGraph):
    """Graph with the parts of a DRL-VO network."""

    def __init__(self, weights: Arrays, batch_norm: str) -> None:
        super().__init__(weights)
        self._sample = batch_norm == "sample"

    def add_network(self) -> None:
        """Add all layers, from image and goal to the means and deviations of the action."""
        image = self.reshape("image", 1, IMAGE, SIDE, SIDE)
        stem = self._relu(self._normed(STEM, image))
        stem = self.node("MaxPool", stem, kernel_shape=[3, 3], pads=[1] * 4)
        first = self._residual(LAYER_1_1, self._residual(LAYER_1_0, stem))
        second = self._residual(REFINEMENT_2, self._residual(LAYER_2, first), first)
        third = self._residual(REFINEMENT_3, self._residual(LAYER_3, second), stem)
        mean = self.node("Flatten", self.node("GlobalAveragePool", third))
        joint = self.node("Concat", mean, self.reshape("goal", 1, GOAL), axis=1)
        features = self._relu(self.linear(joint, FEATURES))
        hidden = self.node("Tanh", self.linear(features, HIDDEN))
        self.reshape(self.linear(hidden, ACTION), ACTIONS, output="means")
        self.node("Exp", LOG_STD, output="deviations")

    def _residual(self, residual: Residual, x: str, start: str | None = None) -> str:
        """Add a residual block. start: the input of its shortcut, if not x."""
        first, second, third = residual.inside
        inside = self._relu(self._normed(second, self._relu(self._normed(first, x))))
        start = start or x
        shortcut = self._normed(residual.shortcut, start) if residual.shortcut else start
        return self._relu(self.node("Add", self._normed(third, inside), shortcut))

    def _normed(self, layer: Convolution, x: str) -> str:
        """Add a convolution and its norm. For a single sample, batch norm is instance norm."""
        parts = ("weight", "bias") if layer.bias else ("weight",)
        weights = [f"{EXTRACTOR}{layer.name}.{part}" for part in parts]
        pads, strides = [layer.kernel // 2] * 4, [layer.stride] * 2
        x = self.node("Conv", x, *weights, kernel_shape=[layer.kernel] * 2, pads=pads, strides=strides)
        scale, bias, *statistics = (f"{EXTRACTOR}{layer.norm}.{part}" for part in NORM)
        if self._sample:
            return self.node("InstanceNormalization", x, scale, bias, epsilon=_EPSILON)
        return self.node("BatchNormalization", x, scale, bias, *statistics, epsilon=_EPSILON)

    def _relu(self, x: str) -> str:
        return self.node("Relu", x)
