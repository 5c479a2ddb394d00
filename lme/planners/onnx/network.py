"""The network in an ONNX file, run by onnxruntime."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lme.errors import InputError
from lme.guarded_file import check_regular
from lme.planners.onnx.features import Part
from lme.requirements import install
from lme.types import Floats

_ONNX_BYTES = 2**31  # a file of protobuf has no more
_TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}


class Network:
    """The policy on one core.

    path: of the file. sizes: of the parts that `planner.inputs` names, in order. A network with one input takes them
    joined, one with several takes each by its name. Raises InputError if onnxruntime is not installed, the file cannot
    be read, or its inputs or outputs are others.
    """

    def __init__(self, path: Path, sizes: Mapping[str, int]) -> None:
        self._path, self._session = path, _session(path)
        self._inputs = self._session.get_inputs()
        self._joined = len(self._inputs) == 1
        self._check_inputs(sizes)
        self.answer({part: np.zeros(size, dtype=np.float32) for part, size in sizes.items()})

    def answer(self, parts: Mapping[str, Part]) -> Floats:
        """The first two outputs (2,) for the parts of one observation."""
        joined = np.concatenate(list(parts.values())) if self._joined else None
        given = {}
        for each in self._inputs:
            values = parts[each.name] if joined is None else joined
            given[each.name] = values.astype(_TYPES[each.type]).reshape((1,) * (len(each.shape) - 1) + (-1,))
        try:
            outputs = self._session.run(None, given)
        except Exception as error:  # onnxruntime has no common class of errors
            raise InputError(f"planner.path is {self._path}: the network fails: {_line(error)}") from error
        answer = np.asarray(outputs[0], dtype=np.float64).ravel()
        if answer.shape != (2,):
            shape = np.shape(outputs[0])
            raise InputError(
                f"planner.path is {self._path}: its first output has the shape {shape}; must be two numbers, "
                "for v and omega"
            )
        return answer

    def _check_inputs(self, sizes: Mapping[str, int]) -> None:
        for each in self._inputs:
            if each.type not in _TYPES:
                raise InputError(
                    f"planner.path is {self._path}: its input {each.name} is a {each.type}; "
                    f"must be one of {', '.join(_TYPES)}"
                )
            if not self._joined and each.name not in sizes:
                names = ", ".join(each.name for each in self._inputs)
                raise InputError(
                    f"planner.inputs is {list(sizes)}: must name all inputs of {self._path}, which are {names}"
                )
            size = sum(sizes.values()) if self._joined else sizes[each.name]
            takes = each.shape[-1] if each.shape else 1
            if isinstance(takes, int) and takes != size:
                parts = sizes if self._joined else {each.name: size}
                makes = " + ".join(f"{part} {count}" for part, count in parts.items())
                raise InputError(
                    f"planner.path is {self._path}: its input {each.name} takes {takes} numbers, but planner.inputs "
                    f"and planner.scan make {size} ({makes}): must be equal"
                )


def _session(path: Path) -> Any:
    try:
        import onnxruntime as runtime
    except ModuleNotFoundError as error:
        raise InputError(f"the planner onnx needs onnxruntime: {install('onnxruntime')}") from error
    if not path.is_file():
        raise InputError(f"planner.path is {path}: must be the path of an .onnx file")
    check_regular(path, _ONNX_BYTES)
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # the executors fill the cores
    try:
        return runtime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has no common class of errors
        raise InputError(f"planner.path is {path}: cannot be read as an ONNX file: {_line(error)}") from error


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
