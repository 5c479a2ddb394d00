"""Untrusted ONNX files: networks that onnxruntime runs on one core."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import decode_json, read_bytes
from lme.inputs.protobuf import fields
from lme.requirements import install
from lme.types import Floats

Arrays = Mapping[str, NDArray[np.float32]]
Shape = tuple[int, ...]

NETWORK_BYTES = 2**28  # greatest size of a file; the largest published network has 11 MB
# Metadata of lme's own files: which network, and what it was trained for.
KIND, TRAINED = "network", "trained"
_ROUNDING = 1e-4  # of a bound, which a file holds as float32
_SILENT = 4  # log level of onnxruntime, whose errors contain what it logs
_FLOAT = "tensor(float)"
# Messages of onnxruntime about files that it cannot load, and what to do about them.
_REASONS = (
    (
        r"Unsupported model IR version: (\d+), max supported IR version: (\d+)",
        r"it has the IR version \1, and onnxruntime {version} reads up to \2: export it with an older onnx, or update "
        "onnxruntime",
    ),
    (
        r"Opset (\d+) is under development.*support for domain (\S+) is till opset (\d+)",
        r"it has the opset \1 of \2, and onnxruntime {version} reads up to \3: export it with opset_version=\3, or "
        "update onnxruntime",
    ),
    (
        r"(?:No Op registered for|Fatal error:) (\S+?)(?:\(-?\d+\))?(?: with| is not a registered).*",
        r"onnxruntime {version} has no operator \1: export it with standard operators",
    ),
    (
        r"(?:Protobuf parsing failed|ModelProto does not have a graph|No graph was found).*",
        "it is damaged, or no ONNX file",
    ),
)
# Where a message of an ONNX file can hold tensors: the kind of message in each field. Source: onnx/onnx.proto.
_MESSAGES = {
    "model": {7: "graph", 25: "function"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node", 11: "attribute"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
}
_DATA_LOCATION, _INSIDE = 14, 0  # field of a tensor, and its value for numbers in the file itself


class OnnxNetwork:
    """Network in an ONNX file, which does not change when it runs.

    path: of the file. source: names the file in messages. inputs, outputs: as onnxruntime describes them, with name,
    shape and type. metadata: texts by key. Raises InputError if onnxruntime is not installed, or if the file cannot be
    read, has more than `NETWORK_BYTES`, or keeps its weights in other files.
    """

    def __init__(self, path: Path, source: str | None = None) -> None:
        self.source = source or str(path)
        try:
            import onnxruntime as runtime
        except ModuleNotFoundError as error:
            raise InputError(
                f"{self.source}: needs onnxruntime: {install('onnxruntime')}, or the extra onnx of lme"
            ) from error
        options = runtime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # the executors fill the cores
        options.log_severity_level = _SILENT
        runtime.set_default_logger_severity(_SILENT)
        content = onnx_content(path, self.source)
        try:
            self._session = runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
            self.inputs, self.outputs = self._session.get_inputs(), self._session.get_outputs()
            self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        except Exception as error:  # onnxruntime has no common class of errors
            reason = _reason(_line(error), str(runtime.__version__))
            raise InputError(f"{self.source}: cannot be read as an ONNX file: {reason}") from error

    def __deepcopy__(self, memo: dict[int, Any]) -> OnnxNetwork:
        """Return the network itself, so that whatever runs it can be copied."""
        return self

    def run(self, inputs: Mapping[str, NDArray[Any]]) -> list[Any]:
        """Return the outputs for arrays by the inputs' names. Raises InputError if the network fails."""
        try:
            outputs: list[Any] = self._session.run(None, inputs)
        except Exception as error:  # onnxruntime has no common class of errors
            raise InputError(f"{self.source}: the network fails: {_line(error)}") from error
        return outputs


class Signature(NamedTuple):
    """Interface of one of lme's own networks.

    kind: in the file's metadata. what: for messages. inputs, outputs: shapes by name, all of float32. trained: shape of
    the ranges that the network was trained for, in the metadata; None: the file holds none.
    """

    kind: str
    what: str
    inputs: Mapping[str, Shape]
    outputs: Mapping[str, Shape]
    trained: Shape | None = None


class SignedNetwork:
    """Network of a known kind, in a file that `lme learn` or `lme weights import` wrote.

    trained: what it was trained for, in the shape of the signature. Raises InputError, naming the file, if it is of
    another kind, has other inputs or outputs, or answers with numbers that are not finite.
    """

    def __init__(self, path: Path, signature: Signature) -> None:
        self._network, self._inputs = OnnxNetwork(path), tuple(signature.inputs)
        kind = self._network.metadata.get(KIND)
        if kind != signature.kind:
            marked = "not marked as one of lme's networks" if kind is None else f"of the kind {kind!r}"
            raise InputError(
                f"{path}: is {marked}: must be {signature.what}, as lme learn and lme weights import write it"
            )
        takes = {each.name: (tuple(each.shape), each.type) for each in self._network.inputs}
        if takes != {name: (shape, _FLOAT) for name, shape in signature.inputs.items()}:
            raise InputError(
                f"{path}: takes {takes}: must be {signature.what}, with {dict(signature.inputs)}"
            )
        gives = [(each.name, each.type) for each in self._network.outputs]
        if gives != [(name, _FLOAT) for name in signature.outputs]:
            raise InputError(
                f"{path}: gives {gives}: must be {signature.what}, with {dict(signature.outputs)}"
            )
        # Run it once, since a file may promise other shapes than it gives.
        answers = self.answer(*(np.ones(shape) for shape in signature.inputs.values()))
        shapes = [answer.shape for answer in answers]
        if shapes != list(signature.outputs.values()):
            raise InputError(
                f"{path}: gives {shapes}: must be {signature.what}, with {dict(signature.outputs)}"
            )
        if not all(np.isfinite(answer).all() for answer in answers):
            raise InputError(f"{path}: answers with values that are not finite")
        self.trained = _trained(self._network, signature.trained)

    def answer(self, *inputs: Floats | NDArray[np.float32]) -> list[Floats]:
        """Return the outputs in float64 for the inputs, both in the order of the signature."""
        given = {
            name: array.astype(np.float32, copy=False)
            for name, array in zip(self._inputs, inputs, strict=True)
        }
        return [output.astype(np.float64) for output in self._network.run(given)]


def onnx_content(path: Path, source: str) -> bytes:
    """Return the content of an ONNX file that needs no other file. Raises InputError. source: as in `OnnxNetwork`."""
    try:
        content = read_bytes(path, NETWORK_BYTES)
        external = _has_external_tensor(content)
    except OSError as error:
        raise InputError(f"{source}: cannot be read ({error.strerror or error})") from None
    except InputError:
        raise
    except ValueError:
        raise InputError(
            f"{source}: cannot be read as an ONNX file: it is damaged, or no ONNX file"
        ) from None
    if external:
        raise InputError(
            f"{source}: its weights are in another file: export all into one, with external_data=False"
        )
    return content


def warn_if_untrained(said: Sequence[str], values: Floats, trained: Floats, network: str) -> None:
    """Warn of each value for which a network was not trained.

    said: what to call each value, such as "robot has v_max". values: (K,). trained: (K, 2), lowest and highest values.
    """
    for name, value, (low, high) in zip(said, values, trained, strict=True):
        if not low - _ROUNDING <= value <= high + _ROUNDING:
            span = f"{low:.3g} to {high:.3g}" if low < high else f"{low:.3g}"
            warnings.warn(f"{name} {value:g}: this {network} network was trained for {span}", stacklevel=4)


def _trained(network: OnnxNetwork, shape: Shape | None) -> Floats:
    if shape is None:
        return np.empty(0)
    try:
        trained: Floats = np.array(decode_json(network.metadata[TRAINED]), np.float64)
    except (KeyError, ValueError, TypeError):
        trained = np.empty(0)
    if trained.shape != shape or not np.isfinite(trained).all():
        raise InputError(f"{network.source}: must hold what the network was trained for, {shape} numbers")
    return trained


def _has_external_tensor(content: bytes) -> bool:
    """Return whether a tensor of the file has its numbers in another file. Raises ValueError for a damaged file."""
    waiting = [("model", memoryview(content))]
    while waiting:
        kind, message = waiting.pop()
        for field, value in fields(message):
            if kind == "tensor":
                if field == _DATA_LOCATION and value != _INSIDE:
                    return True
            elif field in _MESSAGES[kind] and not isinstance(value, int):
                waiting.append((_MESSAGES[kind][field], value))
    return False


def _reason(said: str, version: str) -> str:
    """Reason why a file cannot be loaded, in plain words for known errors."""
    for pattern, words in _REASONS:
        found = re.search(pattern, said)
        if found:
            return found.expand(words.format(version=version))
    return said


def _line(error: Exception) -> str:
    """Message of onnxruntime, without its own files, line numbers and functions."""
    said = re.sub(
        r"^\[ONNXRuntimeError\] : \d+ : \w+ : (?:Load model from .* failed:)?",
        "",
        " ".join(str(error).split()),
    )
    return re.sub(r"\S+\.(?:cc|h):\d+ (?:[^()]*\(.*?\) )?", "", said)
