"""Network in an ONNX file, run by onnxruntime."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lme.errors import InputError, argument_error
from lme.inputs.guarded_file import check_regular
from lme.planners.onnx.features import Part
from lme.requirements import install
from lme.types import Floats

_ONNX_BYTES = 2**31  # greatest size of a protobuf file
_TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}
_NUMBERS = re.compile(r"tensor\((u?int\d+|float\d*|double)\)")
_SILENT = 4  # log level of onnxruntime, whose errors contain what it logs
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
        r"(?i:external (?:data|initializer)).*",
        "its weights are in another file, which cannot be read: keep that file beside it, or export all into one file",
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


class Network:
    """Policy in an ONNX file, run on one core.

    path: of the file. sizes: of the parts that `planner.inputs` names, in order. A network with one input takes them
    joined, one with several takes each by its name. Raises InputError if onnxruntime is not installed, the file cannot
    be read, or its inputs or outputs do not match.
    """

    def __init__(self, path: Path, sizes: Mapping[str, int]) -> None:
        self._path, self._session = path, _session(path)
        self._inputs = self._session.get_inputs()
        self._joined = len(self._inputs) == 1
        self._check_inputs(sizes)
        self._check_output()
        self.answer({part: np.zeros(size, dtype=np.float32) for part, size in sizes.items()})

    def answer(self, parts: Mapping[str, Part]) -> Floats:
        """Return the first two outputs (2,) for the parts of one observation."""
        joined = np.concatenate(list(parts.values())) if self._joined else None
        given = {}
        for each in self._inputs:
            values = parts[each.name] if joined is None else joined
            given[each.name] = values.astype(_TYPES[each.type]).reshape((1,) * (len(each.shape) - 1) + (-1,))
        try:
            outputs = self._session.run(None, given)
        except Exception as error:  # onnxruntime has no common class of errors
            raise argument_error(f"path is {self._path}: the network fails: {_line(error)}") from error
        answer = np.asarray(outputs[0], dtype=np.float64).ravel()
        if answer.shape != (2,):
            shape = np.shape(outputs[0])
            raise argument_error(
                f"path is {self._path}: its first output has the shape {shape}; must be two numbers, "
                "for v and omega"
            )
        return answer

    def _check_output(self) -> None:
        outputs = self._session.get_outputs()
        kind = outputs[0].type if outputs else "nothing"
        if not _NUMBERS.fullmatch(kind):
            raise argument_error(
                f"path is {self._path}: its first output is {kind}; must be two numbers, for v and omega"
            )

    def _check_inputs(self, sizes: Mapping[str, int]) -> None:
        if not self._inputs:
            raise argument_error(f"path is {self._path}: has no inputs; must take {', '.join(sizes)}")
        for each in self._inputs:
            if each.type not in _TYPES:
                raise argument_error(
                    f"path is {self._path}: its input {each.name} is a {each.type}; "
                    f"must be one of {', '.join(_TYPES)}"
                )
            if not self._joined and each.name not in sizes:
                names = ", ".join(each.name for each in self._inputs)
                raise argument_error(
                    f"inputs is {list(sizes)}: must name all inputs of {self._path}, which are {names}; "
                    "a recurrent network, which takes its own state, cannot be used"
                )
            size = sum(sizes.values()) if self._joined else sizes[each.name]
            # All axes but the last must be 1 or free.
            if not each.shape or any(isinstance(axis, int) and axis != 1 for axis in each.shape[:-1]):
                raise argument_error(
                    f"path is {self._path}: its input {each.name} has the shape {each.shape}; must be "
                    f"[1, {size}]: export it for a batch of 1, or with a free batch axis"
                )
            # The last axis must have the size of the parts, or be free.
            takes = each.shape[-1]
            if isinstance(takes, int) and takes != size:
                parts = sizes if self._joined else {each.name: size}
                makes = " + ".join(f"{part} {count}" for part, count in parts.items())
                raise argument_error(
                    f"path is {self._path}: its input {each.name} takes {takes} numbers, but inputs "
                    f"and scan make {size} ({makes}): must be equal"
                )


def _session(path: Path) -> Any:
    try:
        import onnxruntime as runtime
    except ModuleNotFoundError as error:
        raise InputError(f"the planner onnx needs onnxruntime: {install('onnxruntime')}") from error
    if not path.is_file():
        raise argument_error(f"path is {path}: must be the path of an .onnx file")
    check_regular(path, _ONNX_BYTES)
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # the executors fill the cores
    options.log_severity_level = _SILENT
    runtime.set_default_logger_severity(_SILENT)
    try:
        return runtime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has no common class of errors
        reason = _reason(_line(error), str(runtime.__version__))
        raise argument_error(f"path is {path}: cannot be read as an ONNX file: {reason}") from error


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
