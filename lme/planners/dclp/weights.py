"""Weights of a DCLP network in a file: an .npz with the arrays of `SHAPES` and `TRAINED`, float32."""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.inputs.array_file import Arrays, read_arrays, write_arrays

Weights = Arrays

DIRECTION_INPUTS, STATE_INPUTS = 6, 8
COMPONENTS, MIXTURE = 4, 5  # of the mixture; logit, mean (2) and log deviation (2) of each
CONVOLUTIONS, HIDDEN = (32, 64, 128), (128, 128, 128, 128)
LAYERS = (*(f"convolution_{i}" for i in (1, 2, 3)), *(f"dense_{i}" for i in (1, 2, 3, 4)), "output")


def _shapes() -> dict[str, tuple[int, ...]]:
    inputs = (DIRECTION_INPUTS, *CONVOLUTIONS[:-1], CONVOLUTIONS[-1] + STATE_INPUTS, *HIDDEN)
    outputs = (*CONVOLUTIONS, *HIDDEN, COMPONENTS * MIXTURE)
    shapes: dict[str, tuple[int, ...]] = {"alpha": ()}
    for layer, rows, columns in zip(LAYERS, inputs, outputs, strict=True):
        shapes |= {f"{layer}.kernel": (rows, columns), f"{layer}.bias": (columns,)}
    return shapes


SHAPES = _shapes()  # of every array of the network by its name; a kernel is (inputs, outputs)
TOLD = ("v_max", "omega_max", "alpha_v", "alpha_omega", "front", "rear", "half_width")  # of a robot, SI units
TRAINED = "trained"  # lowest and highest values of TOLD in the training: (7, 2)
_FILE = {**SHAPES, TRAINED: (len(TOLD), 2)}


def write_weights(weights: Weights, file: IO[bytes]) -> None:
    """Write the arrays of `SHAPES` and `TRAINED` as .npz. The same weights give the same bytes."""
    write_arrays({name: weights[name] for name in _FILE}, file)


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read the arrays of `SHAPES` and `TRAINED` from a file that `write_weights` made.

    Raises InputError, naming file and array, for a file that cannot be read, arrays of other names, types or
    shapes, and values that are not finite. No array is created before its shape is known to be right.
    """
    return read_arrays(path, _FILE, "a DCLP network")
