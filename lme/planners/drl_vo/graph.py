"""The DRL-VO network of any size as an ONNX file.

Names and shapes of the weights are those of the policy's `state_dict` in Stable-Baselines3.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.inputs.onnx_file import TRAINED, Arrays, Signature
from lme.inputs.onnx_graph import OnnxGraph
from lme.inputs.onnx_graph import read_weights as read_arrays
from lme.planners.drl_vo import architecture as net
from lme.planners.drl_vo.architecture import Convolution, Residual

REPORTED = ("v_max", "omega_max")  # of the planner: the greatest commands that it gives
SIGNATURE = Signature(
    "drl_vo",
    "a DRL-VO network",
    {
        "image": (net.IMAGE, net.SIDE, net.SIDE),
        "goal": (net.GOAL,),
    },  # `observation.image_of`; look-ahead distances
    {"means": (net.ACTIONS,), "deviations": (net.ACTIONS,)},
    (len(REPORTED),),  # the greatest values of REPORTED
)
_EPSILON = 1e-5  # of the norms, PyTorch's default


def write_weights(weights: Arrays, file: IO[bytes], batch_norm: str = "running") -> None:
    """Write a network as an ONNX file. The same weights give the same bytes.

    weights: the arrays that `architecture` lists, and `TRAINED`. batch_norm: "sample" normalises by mean and variance
    of each feature map itself, "running" by those of the training. Raises InputError, naming the array, if one is
    missing or has another shape.
    """
    sizes = net.checked_sizes({name: array.shape for name, array in weights.items()}, "weights")
    graph = _Graph({name: weights[name] for name in net.shapes(sizes)}, batch_norm)
    graph.add_network()
    file.write(graph.model(SIGNATURE, weights[TRAINED]))


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read the arrays that `architecture` lists from a file that `write_weights` made, to train them on.

    Raises InputError, naming file and array, for a file that cannot be read, and for other arrays.
    """
    arrays = read_arrays(path, SIGNATURE.what)
    sizes = net.checked_sizes({name: array.shape for name, array in arrays.items()}, str(path))
    return {name: arrays[name] for name in net.shapes(sizes)}


class _Graph(OnnxGraph):
    """Graph with the parts of a DRL-VO network."""

    def __init__(self, weights: Arrays, batch_norm: str) -> None:
        super().__init__(weights)
        self._sample = batch_norm == "sample"

    def add_network(self) -> None:
        """Add all layers, from image and goal to the means and deviations of the action."""
        image = self.reshape("image", 1, net.IMAGE, net.SIDE, net.SIDE)
        stem = self._relu(self._normed(net.STEM, image))
        stem = self.node("MaxPool", stem, kernel_shape=[3, 3], pads=[1] * 4)
        first = self._residual(net.LAYER_1_1, self._residual(net.LAYER_1_0, stem))
        second = self._residual(net.REFINEMENT_2, self._residual(net.LAYER_2, first), first)
        third = self._residual(net.REFINEMENT_3, self._residual(net.LAYER_3, second), stem)
        mean = self.node("Flatten", self.node("GlobalAveragePool", third))
        joint = self.node("Concat", mean, self.reshape("goal", 1, net.GOAL), axis=1)
        features = self._relu(self.linear(joint, net.FEATURES))
        hidden = self.node("Tanh", self.linear(features, net.HIDDEN))
        self.reshape(self.linear(hidden, net.ACTION), net.ACTIONS, output="means")
        self.node("Exp", net.LOG_STD, output="deviations")

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
        weights = [f"{net.EXTRACTOR}{layer.name}.{part}" for part in parts]
        pads, strides = [layer.kernel // 2] * 4, [layer.stride] * 2
        x = self.node("Conv", x, *weights, kernel_shape=[layer.kernel] * 2, pads=pads, strides=strides)
        scale, bias, *statistics = (f"{net.EXTRACTOR}{layer.norm}.{part}" for part in net.NORM)
        if self._sample:
            return self.node("InstanceNormalization", x, scale, bias, epsilon=_EPSILON)
        return self.node("BatchNormalization", x, scale, bias, *statistics, epsilon=_EPSILON)

    def _relu(self, x: str) -> str:
        return self.node("Relu", x)
