"""ONNX files of lme's own networks: a graph of layers over named weights, written and read with the package onnx."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.onnx_file import KIND, TRAINED, Arrays, Shape, Signature, onnx_content
from lme.requirements import install

_OPSET, _IR = 17, 8  # of 2022: every onnxruntime since 1.12 reads them


class OnnxGraph:
    """Nodes and weights of a network. Methods add nodes and return the name of their output.

    weights: float32, by name; the file holds all of them, under the same names. Raises InputError if the package onnx
    is not installed.
    """

    def __init__(self, weights: Arrays) -> None:
        self._onnx = _onnx()
        self._nodes: list[Any] = []
        self._names = weights.keys()
        self._weights = [
            self._onnx.numpy_helper.from_array(np.asarray(array, np.float32, order="C"), name)
            for name, array in weights.items()
        ]

    def node(self, operator: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        """Add a node of one output. inputs: names of outputs, of weights, or of the network's inputs."""
        output = output or f"{operator}_{len(self._nodes)}"
        self._nodes.append(self._onnx.helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    def constant(self, values: Sequence[int] | float) -> str:
        """Add a list of integers, such as a shape, or a number."""
        array = np.array(values, np.float32 if isinstance(values, float) else np.int64)
        return self.node("Constant", value=self._onnx.numpy_helper.from_array(array))

    def linear(self, x: str, layer: str) -> str:
        """Add x @ LAYER.kernel + LAYER.bias, or with LAYER.weight, which is (outputs, inputs), as in PyTorch."""
        if f"{layer}.kernel" in self._names:
            return self.node("Gemm", x, f"{layer}.kernel", f"{layer}.bias", transB=0)
        return self.node("Gemm", x, f"{layer}.weight", f"{layer}.bias", transB=1)

    def leaky(self, x: str, layer: str, slope: float) -> str:
        """Add `linear`, and then a leaky ReLU."""
        return self.node("LeakyRelu", self.linear(x, layer), alpha=slope)

    def reshape(self, x: str, *shape: int, output: str | None = None) -> str:
        """Add a change of shape; −1: as many as there are."""
        return self.node("Reshape", x, self.constant(shape), output=output)

    def columns(self, x: str, first: int, end: int) -> str:
        """Add the choice of columns [first, end) of the last axis."""
        return self.node("Slice", x, self.constant([first]), self.constant([end]), self.constant([-1]))

    def model(self, signature: Signature, trained: NDArray[Any] | None = None) -> bytes:
        """Return the file. trained: as the signature has it. The same weights give the same bytes."""
        onnx, helper = self._onnx, self._onnx.helper
        inputs, outputs = (
            [
                helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape)
                for name, shape in part.items()
            ]
            for part in (signature.inputs, signature.outputs)
        )
        graph = helper.make_graph(self._nodes, signature.kind, inputs, outputs, self._weights)
        opset = [helper.make_opsetid("", _OPSET)]
        model = helper.make_model(graph, opset_imports=opset, ir_version=_IR, producer_name="lme")
        metadata = {KIND: signature.kind}
        if trained is not None:
            metadata[TRAINED] = json.dumps(trained.tolist())
        helper.set_model_props(model, metadata)
        content: bytes = model.SerializeToString()
        return content


def read_weights(
    path: Path, what: str, shapes: Mapping[str, Shape] | None = None
) -> dict[str, NDArray[np.float32]]:
    """Return the float32 weights in a file that `OnnxGraph` made, by name, to train them on.

    what: network whose weights the file should hold, for messages. shapes: of the arrays to return; None: all. Raises
    InputError, naming file and array, for a file that cannot be read, other shapes, and values that are not finite.
    """
    onnx, content = _onnx(), onnx_content(path, str(path))
    try:
        model = onnx.load_model_from_string(content)
        tensors = [each for each in model.graph.initializer if each.data_type == onnx.TensorProto.FLOAT]
        arrays = {each.name: onnx.numpy_helper.to_array(each).copy() for each in tensors}
    except Exception as error:  # damaged bytes can raise anything
        raise InputError(f"{path}: is not a file of {what} ({type(error).__name__})") from None
    check_finite(arrays, str(path))
    if shapes is None:
        return arrays
    for name, shape in shapes.items():
        if name not in arrays or arrays[name].shape != shape:
            found = f"has the shape {arrays[name].shape}" if name in arrays else "is missing"
            raise InputError(f"{path}: {name} {found}: must be float32 {shape} in {what}")
    return {name: arrays[name] for name in shapes}


def check_finite(arrays: Arrays, source: str) -> None:
    """Raise InputError, naming the array, for values that are not finite. source: the file, for messages."""
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise InputError(f"{source}: {name} holds values that are not finite")


def _onnx() -> Any:
    try:
        import onnx
    except ModuleNotFoundError as error:
        raise InputError(
            f"writing and reading the weights of networks needs onnx: {install('onnx')}"
        ) from error
    return onnx
