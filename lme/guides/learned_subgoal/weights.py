"""The weights of a subgoal network in a file: an .npz with the arrays of `SHAPES` and `TRAINED`, float32."""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.guides.learned_subgoal.candidates import BEARINGS, CANDIDATES
from lme.inputs.array_file import Arrays, read_arrays, write_arrays

Weights = Arrays

STATE_INPUTS = 11  # target 3, twist 2, limits 4, last subgoal 2
HIDDEN = (128, 128)  # ASSUMED
LAYERS = ("hidden_1", "hidden_2", "output")


def _shapes() -> dict[str, tuple[int, ...]]:
    widths = (2 * BEARINGS + STATE_INPUTS, *HIDDEN, CANDIDATES)
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, rows, columns in zip(LAYERS, widths[:-1], widths[1:], strict=True):
        shapes |= {f"{layer}.kernel": (rows, columns), f"{layer}.bias": (columns,)}
    return shapes


SHAPES = _shapes()  # of every array of the network by its name; a kernel is (inputs, outputs)
TOLD = ("v_max", "omega_max", "alpha_v", "alpha_omega", "length", "width")  # of a robot, SI units
TRAINED = "trained"  # lowest and highest values of TOLD in the training: (6, 2)
_FILE = {**SHAPES, TRAINED: (len(TOLD), 2)}


def write_weights(weights: Weights, file: IO[bytes]) -> None:
    """Write the arrays of `SHAPES` and `TRAINED` as .npz. The same weights give the same bytes."""
    write_arrays({name: weights[name] for name in _FILE}, file)


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read the arrays of `SHAPES` and `TRAINED` from a file. Raises InputError as `read_arrays` does."""
    return read_arrays(path, _FILE, "a subgoal network")
