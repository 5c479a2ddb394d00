"""Policy in an ONNX file: its inputs and outputs, checked."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lme.errors import argument_error, config_key
from lme.inputs.onnx_file import OnnxNetwork
from lme.planners.onnx.features import Part
from lme.types import Floats

_TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}
_NUMBERS = re.compile(r"tensor\((u?int\d+|float\d*|double)\)")


class Network:
    """Policy in an ONNX file.

    path: of the file. sizes: of the parts that `inputs` names, in order. A network with one input takes them
    joined, one with several takes each by its name. Raises InputError as `OnnxNetwork` does, and if inputs or outputs
    do not match.
    """

    def __init__(self, path: Path, sizes: Mapping[str, int]) -> None:
        self._path, self._network = path, OnnxNetwork(path, config_key(f"path is {path}"))
        self._inputs = self._network.inputs
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
        outputs = self._network.run(given)
        answer = np.asarray(outputs[0], dtype=np.float64).ravel()
        if answer.shape != (2,):
            shape = np.shape(outputs[0])
            raise argument_error(
                f"path is {self._path}: its first output has the shape {shape}; must be two numbers, "
                "for v and omega"
            )
        return answer

    def _check_output(self) -> None:
        outputs = self._network.outputs
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
