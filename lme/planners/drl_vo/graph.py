"""The DRL-VO network as an ONNX model."""

from __future__ import annotations

from typing import Any

from lme.inputs.array_file import Arrays
from lme.planners.drl_vo import architecture as net
from lme.planners.drl_vo.architecture import Convolution, Residual

IMAGE_INPUT, GOAL_INPUT, OUTPUT = "image", "goal", "action"
_OPSET, _IR = 17, 8  # of 2022: every onnxruntime since 1.12 reads them
_EPSILON = 1e-5  # of the norms, PyTorch's default


def onnx_model(weights: Arrays, batch_norm: str) -> bytes:
    """Return the network from image (1, 3, 80, 80) and goal (1, 2) to the action's means (1, 2), as ONNX.

    weights: the arrays that `architecture` lists. batch_norm: "sample" or "running".
    """
    return _Graph(weights, batch_norm).model()


class _Graph:
    """Nodes and weights of the model. Methods add nodes and return the name of their output."""

    def __init__(self, weights: Arrays, batch_norm: str) -> None:
        import onnx

        self._onnx = onnx
        self._weights = weights
        self._sample = batch_norm == "sample"
        self._nodes: list[Any] = []
        self._tensors: list[Any] = []

    def model(self) -> bytes:
        onnx, helper = self._onnx, self._onnx.helper
        self._network()
        inputs = (IMAGE_INPUT, (1, net.IMAGE, net.SIDE, net.SIDE)), (GOAL_INPUT, (1, net.GOAL))
        given = [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape) for name, shape in inputs]
        answer = [helper.make_tensor_value_info(OUTPUT, onnx.TensorProto.FLOAT, (1, net.ACTIONS))]
        graph = helper.make_graph(self._nodes, "drl_vo", given, answer, self._tensors)
        opset = [helper.make_opsetid("", _OPSET)]
        made: bytes = helper.make_model(graph, opset_imports=opset, ir_version=_IR).SerializeToString()
        return made

    def _network(self) -> None:
        stem = self._relu(self._normed(net.STEM, IMAGE_INPUT))
        stem = self._node("MaxPool", stem, kernel_shape=[3, 3], pads=[1] * 4)
        first = self._residual(net.LAYER_1_1, self._residual(net.LAYER_1_0, stem))
        second = self._residual(net.REFINEMENT_2, self._residual(net.LAYER_2, first), first)
        third = self._residual(net.REFINEMENT_3, self._residual(net.LAYER_3, second), stem)
        mean = self._node("Flatten", self._node("GlobalAveragePool", third))
        features = self._relu(self._linear(net.FEATURES, self._node("Concat", mean, GOAL_INPUT, axis=1)))
        hidden = self._node("Tanh", self._linear(net.HIDDEN, features))
        self._linear(net.ACTION, hidden, OUTPUT)

    def _residual(self, residual: Residual, x: str, start: str | None = None) -> str:
        """Add a residual block. start: the input of its shortcut, if not x."""
        first, second, third = residual.inside
        inside = self._relu(self._normed(second, self._relu(self._normed(first, x))))
        start = start or x
        shortcut = self._normed(residual.shortcut, start) if residual.shortcut else start
        return self._relu(self._node("Add", self._normed(third, inside), shortcut))

    def _normed(self, layer: Convolution, x: str) -> str:
        """Add a convolution and its norm. For a single sample, batch norm is instance norm."""
        given = self._weight_inputs(
            f"{net.EXTRACTOR}{layer.name}", "weight", *(["bias"] if layer.bias else [])
        )
        pads, strides = [layer.kernel // 2] * 4, [layer.stride] * 2
        x = self._node("Conv", x, *given, kernel_shape=[layer.kernel] * 2, pads=pads, strides=strides)
        norm = f"{net.EXTRACTOR}{layer.norm}"
        if self._sample:
            scale_and_bias = self._weight_inputs(norm, "weight", "bias")
            return self._node("InstanceNormalization", x, *scale_and_bias, epsilon=_EPSILON)
        statistics = self._weight_inputs(norm, "weight", "bias", "running_mean", "running_var")
        return self._node("BatchNormalization", x, *statistics, epsilon=_EPSILON)

    def _linear(self, name: str, x: str, output: str | None = None) -> str:
        return self._node("Gemm", x, *self._weight_inputs(name, "weight", "bias"), output=output, transB=1)

    def _relu(self, x: str) -> str:
        return self._node("Relu", x)

    def _weight_inputs(self, layer: str, *parts: str) -> list[str]:
        """Add a layer's weights to the model and return their names."""
        names = [f"{layer}.{part}" for part in parts]
        for name in names:
            self._tensors.append(self._onnx.numpy_helper.from_array(self._weights[name], name))
        return names

    def _node(self, kind: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        output = output or f"{kind}_{len(self._nodes)}"
        self._nodes.append(self._onnx.helper.make_node(kind, list(inputs), [output], **attributes))
        return output
